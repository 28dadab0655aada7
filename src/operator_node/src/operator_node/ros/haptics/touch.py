"""3D Systems Touch (Phantom Omni, Geomagic Touch), by the topics of its drivers."""

import math
import threading
import time
from typing import Literal

import rospy
from geometry_msgs.msg import TwistStamped, Vector3, Wrench
from omni_msgs.msg import OmniButtonEvent, OmniFeedback, OmniState
from pydantic import Field
from tf2_msgs.msg import TFMessage

from custom_ros_tools.schema import Hz, Name, Positive, PositiveMetres, Text, Vec3
from operator_node.device import DeviceError
from operator_node.haptics.device import HapticConfig, HapticDevice, HapticReading, ReadingError
from operator_node.haptics.vectors import ZERO
from rpbi.geometry import Vector, minus, scaled

PATIENCE_S = 1.0
"""After so long without a state the driver counts as gone [s]."""
GOODBYES, GOODBYE_S = 30, 0.01
"""So often zero is sent at the end, and so far apart: the driver holds the last force for ever, and rospy's own thread
needs the time to send."""


class TouchConfig(HapticConfig):
    """A Touch, and what its driver is like."""

    max_force_n: Positive = Field(3.0, description="The largest force that it is sent [N]; the Touch X has 7.9.")
    workspace_m: PositiveMetres = Field(0.1, description="Radius of its workspace.")
    driver: Literal["omni", "touch_x"] = Field(
        "omni", description="omni: omni_msgs, as omni_common has them; touch_x: cmd_force, twist and TF."
    )
    name: Name = Field("phantom", description="What the topics begin with.")
    metres_per_unit: Positive = Field(0.001, description="Unit of lengths of `omni`: 0.001 for mm, 1 for m.")
    handle_frame: Text = Field("touch_x_ee", description="TF frame of the handle, of `touch_x`.")
    force_hz: Hz = Field(1000.0, description="How often a force is published at most.")
    centre: Vec3 = Field((0.0, 0.0, 0.0), description="Middle of the workspace in the driver's own axes [m].")


class TouchDevice(HapticDevice):
    """States and forces are topics; the newest state counts."""

    Config = TouchConfig
    config: TouchConfig

    def __init__(self, config: TouchConfig) -> None:
        super().__init__(config)
        self._lock = threading.Lock()
        self._newest: HapticReading | None = None
        self._buttons: tuple[int, ...] = ()
        self._velocity: Vector | None = None
        self._seen_s = self._sent_s = 0.0
        self._force: rospy.Publisher | None = None

    def open(self) -> None:
        """Subscribes, and waits for the first state.

        Raises:
            DeviceError: If none comes.
        """
        name = self.config.name
        if self.config.driver == "omni":
            self._subscribers = [
                rospy.Subscriber(f"{name}/state", OmniState, self._take_state, queue_size=1, tcp_nodelay=True),
                rospy.Subscriber(f"{name}/button", OmniButtonEvent, self._take_buttons, queue_size=10),
            ]
            self._force = rospy.Publisher(f"{name}/force_feedback", OmniFeedback, queue_size=1, tcp_nodelay=True)
        else:
            self._subscribers = [
                rospy.Subscriber("/tf", TFMessage, self._take_tf, queue_size=100, tcp_nodelay=True),
                rospy.Subscriber(f"{name}/twist", TwistStamped, self._take_twist, queue_size=1, tcp_nodelay=True),
            ]
            self._force = rospy.Publisher(f"{name}/cmd_force", Wrench, queue_size=1, tcp_nodelay=True)
        self._seen_s = opened_s = time.monotonic()
        while self._newest is None:
            if time.monotonic() - opened_s > PATIENCE_S or rospy.is_shutdown():
                self.close()
                raise DeviceError("touch", f"no state comes from the driver '{self.config.driver}' of '{name}'")
            time.sleep(0.01)

    def read(self) -> HapticReading | None:
        """Returns the newest state.

        Raises:
            DeviceError: If none has come for long.
            ReadingError: If it is not made of finite numbers.
        """
        with self._lock:
            reading, self._newest = self._newest, None
        if reading is None:
            if time.monotonic() - self._seen_s > PATIENCE_S:
                raise DeviceError("touch", f"nothing has come from '{self.config.name}' for {PATIENCE_S:g} s")
            return None
        if not math.isfinite(sum(reading.position)):
            raise ReadingError("not finite", f"position {reading.position}")
        return reading

    def send(self, force: Vector, expires_s: float) -> None:
        """Publishes a force; a driver keeps it, so zero has to follow, which the loop sees to."""
        now_s = time.monotonic()
        if self._force is None or (force != ZERO and now_s - self._sent_s < 1.0 / self.config.force_hz):
            return
        self._sent_s = now_s
        self._publish(force)

    def close(self) -> None:
        """Sends zero, and lets the topics be."""
        if self._force is None:
            return
        for _ in range(GOODBYES):
            self._publish(ZERO)
            time.sleep(GOODBYE_S)
        for each in (*self._subscribers, self._force):
            each.unregister()
        self._force, self._newest = None, None

    def _publish(self, force: Vector) -> None:
        assert self._force is not None
        x, y, z = force
        try:
            if self.config.driver == "omni":
                self._force.publish(OmniFeedback(force=Vector3(-y, x, z)))
            else:
                self._force.publish(Wrench(force=Vector3(-y, z, -x)))
        except rospy.ROSException:
            return  # ROS has shut down

    def _put(self, position: Vector, velocity: Vector | None, quat: tuple[float, float, float, float]) -> None:
        self._seen_s = time.monotonic()
        with self._lock:
            self._newest = HapticReading(position, velocity, quat, self._buttons)

    def _take_state(self, message: OmniState) -> None:
        """Takes a state in axes x right, y forward, z up."""
        p, v, q = message.pose.position, message.velocity, message.pose.orientation
        unit_m = self.config.metres_per_unit
        x, y, z = minus(scaled(unit_m, (p.x, p.y, p.z)), self.config.centre)
        self._put((y, -x, z), scaled(unit_m, (v.y, -v.x, v.z)), (q.y, -q.x, q.z, q.w))

    def _take_buttons(self, message: OmniButtonEvent) -> None:
        self._buttons = int(bool(message.grey_button)), int(bool(message.white_button))

    def _take_tf(self, message: TFMessage) -> None:
        """Takes a transform in axes x right, y up, z towards the person."""
        for transform in message.transforms:
            if transform.child_frame_id.strip("/") == self.config.handle_frame:
                p, q = transform.transform.translation, transform.transform.rotation
                x, y, z = minus((p.x, p.y, p.z), self.config.centre)
                self._put((-z, -x, y), self._velocity, (-q.z, -q.x, q.y, q.w))

    def _take_twist(self, message: TwistStamped) -> None:
        v = message.twist.linear
        self._velocity = -v.z, -v.x, v.y
