"""Haptic device 3D Systems Touch (Phantom Omni, Geomagic Touch), used through the ROS topics of its drivers."""

import math
import threading
import time
from typing import Literal

import rospy
from geomagic_touch_x_ros.msg import OmniFeedback as TouchXFeedback
from geometry_msgs.msg import Point, PoseStamped, Quaternion, TwistStamped, Vector3, Wrench
from omni_msgs.msg import OmniButtonEvent, OmniFeedback, OmniState
from pydantic import Field
from tf2_msgs.msg import TFMessage

from custom_ros_tools.ros.lifecycle.run_node import init_node
from custom_ros_tools.schema import Hz, Name, Positive, PositiveMetres, Text, Vec3
from operator_node.device import DeviceError
from operator_node.haptics.device import DeviceEnded, HapticConfig, HapticDevice, HapticReading, ReadingError
from robot_model.geometry import ZERO, Vector, minus, scaled

PATIENCE_S = 1.0
"""Time without a state after which the driver counts as disconnected [s]."""
FINAL_ZEROS, FINAL_PERIOD_S = 30, 0.01
"""Number and period [s] of the zero forces that are sent at the end.

The driver holds the last force forever, and rospy's thread needs some time to send messages.
"""

MAX_LEAVE_S = 2.0
FORCES: dict[str, tuple[str, type]] = {
    "omni": ("force_feedback", OmniFeedback),
    "pose": ("force_feedback", TouchXFeedback),
    "touch_x": ("cmd_force", Wrench),
}
"""Topic and message type of the forces, keyed by driver."""
ENDED = "its ROS node was shut down"


class TouchConfig(HapticConfig):
    """Options of a 3D Systems Touch and its ROS driver."""

    max_force_n: Positive = Field(
        3.0, description="Largest force that is sent to the device [N]; a Touch X can exert 7.9 N."
    )
    workspace_m: PositiveMetres = Field(0.1, description="Radius of the device's workspace.")
    driver: Literal["omni", "pose", "touch_x"] = Field(
        "omni",
        description="ROS driver of the device. `omni`: omni_msgs, as in omni_common. `pose`: Pose and force_feedback "
        "of geomagic_touch_x_ros, as in the release's human_interaction. `touch_x`: cmd_force, twist and TF, as in "
        "the release's nsl.",
    )
    name: Name = Field("phantom", description="Prefix of the driver's topics.")
    metres_per_unit: Positive = Field(
        0.001, description="Unit of lengths in messages of the driver `omni` [m]: 0.001 for mm, 1 for m."
    )
    handle_frame: Text = Field("touch_x_ee", description="TF frame of the handle, for the driver `touch_x`.")
    force_hz: Hz = Field(1000.0, description="Largest rate of the force messages.")
    centre: Vec3 = Field((0.0, 0.0, 0.0), description="Middle of the workspace in the driver's own axes [m].")


class TouchDevice(HapticDevice):
    """3D Systems Touch. Receives states from the ROS topics of its driver, and publishes forces to the driver.

    The device turns the loop's process into a ROS node. This process therefore communicates with the driver directly,
    and sends zero force even if the haptic node has crashed.
    """

    Config = TouchConfig
    config: TouchConfig

    def __init__(self, config: TouchConfig) -> None:
        super().__init__(config)
        self._lock = threading.Lock()
        self._newest: HapticReading | None = None
        self._buttons: tuple[int, ...] = ()
        self._velocity: Vector | None = None
        self._place = Point()
        self._seen_s = self._sent_s = 0.0
        self._force: rospy.Publisher | None = None
        self._is_leaving, self._closed = False, threading.Event()
        self._closed.set()

    def open(self) -> None:
        """Subscribes to the driver's topics, and waits for the first state.

        Raises:
            DeviceError: If no state arrives within `PATIENCE_S`.
            DeviceEnded: If ROS has shut down.
        """
        if rospy.is_shutdown():
            raise DeviceEnded("touch", ENDED)
        if not rospy.core.is_initialized():
            init_node("haptic_device", {"operator_node"}, ros_time=False)
            rospy.on_shutdown(self._leave)
        name = self.config.name
        if self.config.driver == "omni":
            self._subscribers = [
                rospy.Subscriber(f"{name}/state", OmniState, self._on_state, queue_size=1, tcp_nodelay=True),
                rospy.Subscriber(f"{name}/button", OmniButtonEvent, self._on_buttons, queue_size=10),
            ]
        elif self.config.driver == "pose":
            self._subscribers = [
                rospy.Subscriber(f"{name}/Pose", PoseStamped, self._on_pose, queue_size=1, tcp_nodelay=True)
            ]
        else:
            self._subscribers = [
                rospy.Subscriber("/tf", TFMessage, self._on_tf, queue_size=100, tcp_nodelay=True),
                rospy.Subscriber(f"{name}/twist", TwistStamped, self._on_twist, queue_size=1, tcp_nodelay=True),
            ]
        self._force = self._publisher()
        self._closed.clear()
        self._seen_s = opened_s = time.monotonic()
        while self._newest is None:
            if time.monotonic() - opened_s > PATIENCE_S or rospy.is_shutdown():
                self.close()
                raise DeviceError("touch", f"no state from the driver '{self.config.driver}' of '{name}'")
            time.sleep(0.01)

    def read(self) -> HapticReading | None:
        """Returns the newest state; None if no new state has arrived since the last call.

        Raises:
            DeviceError: If no state has arrived for `PATIENCE_S`.
            DeviceEnded: If ROS is shutting down.
            ReadingError: If a coordinate is not finite.
        """
        if self._is_leaving:
            raise DeviceEnded("touch", ENDED)
        with self._lock:
            reading, self._newest = self._newest, None
        if reading is None:
            if time.monotonic() - self._seen_s > PATIENCE_S:
                raise DeviceError("touch", f"no state from '{self.config.name}' for {PATIENCE_S:g} s")
            return None
        if not math.isfinite(sum(reading.position)):
            raise ReadingError("not finite", f"position {reading.position}")
        return reading

    def send(self, force: Vector, expires_s: float) -> None:
        """Publishes a force, at most `force_hz` times a second. Ignores `expires_s`: drivers hold the last force."""
        now_s = time.monotonic()
        if self._force is None or (force != ZERO and now_s - self._sent_s < 1.0 / self.config.force_hz):
            return
        self._sent_s = now_s
        self._publish(force)

    def close(self) -> None:
        """Sends zero force, and unregisters the topics."""
        if self._force is None:
            return
        self._send_zeros()
        for each in (*self._subscribers, self._force):
            each.unregister()
        self._force, self._newest = None, None
        self._closed.set()

    def silence(self) -> None:
        """Sends zero force. Keeps the publisher open, so that it is already connected at the next call."""
        if self._force is None:
            self._force = self._publisher()
        self._send_zeros()

    def _publisher(self) -> rospy.Publisher:
        topic, kind = FORCES[self.config.driver]
        return rospy.Publisher(f"{self.config.name}/{topic}", kind, queue_size=1, tcp_nodelay=True)

    def _send_zeros(self) -> None:
        for _ in range(FINAL_ZEROS):
            self._publish(ZERO)
            time.sleep(FINAL_PERIOD_S)

    def _leave(self) -> None:
        """Makes the loop close the device, and waits until zero force is sent, before ROS shuts down."""
        self._is_leaving = True
        self._closed.wait(MAX_LEAVE_S)

    def _publish(self, force: Vector) -> None:
        assert self._force is not None
        x, y, z = force
        try:
            if self.config.driver == "omni":
                self._force.publish(OmniFeedback(force=Vector3(-y, x, z)))
            elif self.config.driver == "pose":
                self._force.publish(TouchXFeedback(force=Vector3(-y, z, -x), position=self._place))
            else:
                self._force.publish(Wrench(force=Vector3(-y, z, -x)))
        except rospy.ROSException:
            return  # ROS has shut down

    def _put(self, position: Vector, velocity: Vector | None, quat: tuple[float, float, float, float]) -> None:
        self._seen_s = time.monotonic()
        with self._lock:
            self._newest = HapticReading(position, velocity, quat, self._buttons)

    def _on_state(self, message: OmniState) -> None:
        """Stores a state from the driver type `omni`, whose axes are x right, y forward, z up."""
        v, unit_m = message.velocity, self.config.metres_per_unit
        self._put_pose(message.pose.position, message.pose.orientation, unit_m, scaled(unit_m, (v.y, -v.x, v.z)))

    def _on_pose(self, message: PoseStamped) -> None:
        """Stores a pose [m] from the driver type `pose`, which has axes x right, y forward, z up, and no velocity."""
        self._place = message.pose.position
        self._put_pose(message.pose.position, message.pose.orientation, 1.0, None)

    def _put_pose(self, p: Point, q: Quaternion, unit_m: float, velocity: Vector | None) -> None:
        x, y, z = minus(scaled(unit_m, (p.x, p.y, p.z)), self.config.centre)
        self._put((y, -x, z), velocity, (q.y, -q.x, q.z, q.w))

    def _on_buttons(self, message: OmniButtonEvent) -> None:
        self._buttons = int(bool(message.grey_button)), int(bool(message.white_button))

    def _on_tf(self, message: TFMessage) -> None:
        """Stores the handle's transform from the driver type `touch_x`: axes x right, y up, z towards the user."""
        for transform in message.transforms:
            if transform.child_frame_id.strip("/") == self.config.handle_frame:
                p, q = transform.transform.translation, transform.transform.rotation
                x, y, z = minus((p.x, p.y, p.z), self.config.centre)
                self._put((-z, -x, y), self._velocity, (-q.z, -q.x, q.y, q.w))

    def _on_twist(self, message: TwistStamped) -> None:
        v = message.twist.linear
        self._velocity = -v.z, -v.x, v.y
