"""`haptic_node.py`: a haptic device moves a TF frame, and lets its person feel what the tool there feels."""

import math
import time
from functools import partial
from typing import cast

import rospy
import tf2_ros
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    TransformStamped,
    TwistStamped,
    Vector3,
    WrenchStamped,
)
from sensor_msgs.msg import Joy
from std_msgs.msg import Header
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.plugins import find_in_table
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.services import ToggleService
from custom_ros_tools.ros.tf_listener import TfListener
from custom_ros_tools.ros.transform_messages import position_in, quat_in, transform_message
from custom_ros_tools.toggle import Toggle
from operator_node.haptics.controller import HapticController, Snapshot
from operator_node.haptics.device import HapticDevice
from operator_node.haptics.devices import HAPTIC_DEVICES
from operator_node.haptics.loop import HZ, HapticLoop
from operator_node.haptics.node_config import HapticNodeConfig
from operator_node.haptics.vectors import ZERO
from operator_node.msg import HapticState
from rpbi.geometry import Vector, minus, plus, rotated

QUEUE_SIZE = 10
TOOL_HZ = 500.0
"""How often TF is asked for the tool."""
LOOK_HZ = 50.0
"""How often TF is asked how the sensor is turned."""
TF_CACHE_S = 2.0
NO_ROTATION = (0.0, 0.0, 0.0, 1.0)


class HapticNode:
    """Joins a haptic device to a tool.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        self._config = config = private_parameters(HapticNodeConfig)
        device = _device(config)
        self._name = config.device
        self.controller = HapticController(config, device.config, HZ)
        self.loop = HapticLoop(device, self.controller, config.expiry_s, self._tell)
        self._device = device
        self._warn = ThrottledWarning()
        self._start: tuple[Vector, tuple[float, ...]] | None = None
        self._tool_stamp: rospy.Time | None = None
        self._frame = ""
        self._rotation: tuple[float, float, float, float] | None = NO_ROTATION
        self._sent: Snapshot | None = None
        self._samples, self._samples_s = 0, time.monotonic()
        self._buffer = tf2_ros.Buffer(rospy.Duration.from_sec(TF_CACHE_S), debug=False)
        self._listener = TfListener(self._buffer)
        self._open_topics()
        if config.mode == "coupling" and config.stiffness > self.controller.stiffness_bound:
            rospy.logwarn(
                "%s: a stiffness of %g N/m is above %g N/m, up to which a wall is passive by itself (Colgate): "
                "the passivity controller will have to brake",
                config.device,
                config.stiffness,
                self.controller.stiffness_bound,
            )
        rospy.on_shutdown(self.loop.stop)
        feedback = Toggle("the haptic device", self.loop.start, self.loop.stop)
        if config.start_on_init:
            feedback.on()
        ToggleService("haptics/toggle", feedback.on, feedback.off)
        WallTimer(config.hz, self._publish)
        WallTimer(config.state_hz, self._publish_state)
        WallTimer(LOOK_HZ, self._look_up)
        if config.mode == "coupling":
            WallTimer(TOOL_HZ, self._take_tool)

    def _open_topics(self) -> None:
        publisher = partial(rospy.Publisher, queue_size=QUEUE_SIZE, tcp_nodelay=True)
        self._pose = publisher("haptics/pose", PoseStamped)
        self._twist = publisher("haptics/twist", TwistStamped)
        self._force = publisher("haptics/force", WrenchStamped)
        self._state = publisher("haptics/state", HapticState)
        self._joy = publisher("joy", Joy)
        self._tf = tf2_ros.TransformBroadcaster()
        rospy.Subscriber("haptics/wrench", WrenchStamped, self._take_wrench, queue_size=1, tcp_nodelay=True)
        rospy.Service("haptics/reset", Trigger, self._reset)

    def run(self) -> None:
        """Waits until the person is done with the device, or ROS shuts down."""
        while not rospy.is_shutdown():
            if self.loop.has_ended.wait(0.1):
                self._publish_state()  # that it is over
                time.sleep(0.1)
                rospy.signal_shutdown(self.loop.trouble)

    def _tell(self, line: str) -> None:
        said = f"{self._name}: {line.removeprefix(f'{self._name}: ')}"
        if line == "connected":
            rospy.loginfo(said)
        else:
            rospy.logwarn("%s; the force is zero", said)

    # --- What comes in.

    def _take_wrench(self, message: WrenchStamped) -> None:
        """Takes the force on the tool, which counts from now on."""
        now_s = time.monotonic()
        f = message.wrench.force
        if not math.isfinite(f.x + f.y + f.z):
            self._warn("haptics/wrench", f"refused, expected finite numbers, got {f.x:g}, {f.y:g}, {f.z:g}")
            return
        if message.header.frame_id != self._frame:
            self._frame, self._rotation = message.header.frame_id, None if message.header.frame_id else NO_ROTATION
            self._look_up()
        if (rotation := self._rotation) is not None:
            self.controller.take_wrench(rotated(rotation, (f.x, f.y, f.z)), now_s, _age_s(message.header.stamp))

    def _look_up(self) -> None:
        """Asks TF how the frame of the force is turned."""
        frame = self._frame.strip("/")
        if not frame:
            return
        try:
            found = self._buffer.lookup_transform(self._config.parent_frame_id, frame, rospy.Time(0))
            x, y, z, w = quat_in(found.transform).tolist()
            self._rotation = x, y, z, w
        except (tf2_ros.TransformException, ValueError) as error:
            self._warn("haptics/wrench", f"refused, since its frame '{frame}' is not known: {error}")

    def _tool(self) -> tuple[Vector, tuple[float, ...], rospy.Time] | None:
        """Returns position, orientation and stamp of the tool, None as long as TF does not have it."""
        frame = self._config.tool_frame_id
        if frame is None:
            return ZERO, NO_ROTATION, rospy.Time(0)
        try:
            found = self._buffer.lookup_transform(self._config.parent_frame_id, frame, rospy.Time(0))
            x, y, z = position_in(found.transform).tolist()
            return (x, y, z), tuple(quat_in(found.transform).tolist()), found.header.stamp
        except tf2_ros.TransformException:
            return None
        except ValueError as error:
            self._warn(f"TF of '{frame}'", f"refused: {error}")
            return None

    def _take_tool(self) -> None:
        """Takes where the tool is, if TF says something new."""
        if self._start is None or (found := self._tool()) is None:
            return
        position, _, stamp = found
        if stamp == self._tool_stamp:
            return
        self._tool_stamp = stamp
        self.controller.take_tool(minus(position, self._start[0]), time.monotonic(), _age_s(stamp))

    def _reset(self, _: TriggerRequest) -> TriggerResponse:
        self.controller.reset()
        return TriggerResponse(True, "the target goes back to where it was at the start")

    # --- What goes out.

    def _publish(self) -> None:
        if self._start is None and (found := self._tool()) is not None:
            self._start = found[:2]
        snapshot, config = self.controller.snapshot, self._config
        header = Header(stamp=rospy.Time.now(), frame_id=config.base_frame_id)
        f = self.controller.force
        message = WrenchStamped(header=header)
        message.wrench.force = Vector3(*f)
        self._force.publish(message)
        if snapshot is None or snapshot is self._sent:
            return  # the device is silent
        self._sent = snapshot
        reading = snapshot.reading
        self._pose.publish(PoseStamped(header, Pose(Point(*reading.position), Quaternion(*reading.quat_xyzw))))
        twist = TwistStamped(header=header)
        twist.twist.linear = Vector3(*snapshot.velocity)
        self._twist.publish(twist)
        reach = self._device.config.workspace_m
        axes = [min(max(each / reach, -1.0), 1.0) for each in snapshot.deviation]
        self._joy.publish(Joy(header, axes, reading.buttons))
        self._broadcast(header, snapshot)

    def _broadcast(self, header: Header, snapshot: Snapshot) -> None:
        config, transforms = self._config, []
        handle = TransformStamped(header=header, child_frame_id=config.handle_frame_id)
        handle.transform = transform_message(snapshot.reading.position, snapshot.reading.quat_xyzw)
        transforms.append(handle)
        if config.target_frame_id is not None and self._start is not None:
            position, quat = self._start
            stamped = Header(stamp=header.stamp, frame_id=config.parent_frame_id)
            target = TransformStamped(header=stamped, child_frame_id=config.target_frame_id)
            target.transform = transform_message(plus(position, snapshot.way), quat)
            transforms.append(target)
        self._tf.sendTransform(transforms)

    def _publish_state(self) -> None:
        controller, loop, config = self.controller, self.loop, self._config
        now_s = time.monotonic()
        rate_hz = (loop.samples - self._samples) / (now_s - self._samples_s)
        self._samples, self._samples_s = loop.samples, now_s
        lateness_s, loop.lateness_s = loop.lateness_s, 0.0
        snapshot, delay_s = controller.snapshot, controller.coupling.delay_s(now_s)
        faults = {**controller.faults, **self._device.faults}
        if controller.not_finite:
            faults["force not finite"] = controller.not_finite
        if controller.fault:
            self._warn(config.device, f"reading refused: {controller.fault}")
        self._state.publish(
            HapticState(
                header=Header(stamp=rospy.Time.now()),
                device=config.device,
                connected=loop.is_connected,
                engaged=loop.is_connected and snapshot is not None and snapshot.is_engaged,
                message=loop.trouble or controller.fault or ("" if math.isfinite(delay_s) else "nothing from the tool"),
                stiffness=config.stiffness if config.mode == "coupling" else 0.0,
                damping=config.damping,
                stiffness_bound=controller.stiffness_bound,
                delay=delay_s if math.isfinite(delay_s) else -1.0,
                energy=controller.passivity.energy_j,
                energy_bound=controller.passivity.floor_j,
                interventions=controller.passivity.interventions,
                sample_rate=rate_hz,
                lateness=lateness_s,
                fault_names=sorted(faults),
                fault_counts=[faults[name] for name in sorted(faults)],
            )
        )


def _device(config: HapticNodeConfig) -> HapticDevice:
    """Returns the device, not opened yet.

    Raises:
        ConfigError: If there is no such device, or its options are wrong.
    """
    try:
        device_class = cast(
            type[HapticDevice], find_in_table(config.device, HapticDevice, HAPTIC_DEVICES, "haptic device")
        )
    except ValueError as error:
        raise ConfigError([Problem(rospy.get_name(), "device", str(error))]) from None
    options = device_class.Config.parse(config.device_options, f"{rospy.get_name()}/device_options")
    return device_class(options)


def _age_s(stamp: rospy.Time) -> float:
    """Returns how old a stamp is [s]; 0 without one."""
    return max((rospy.Time.now() - stamp).to_sec(), 0.0) if stamp else 0.0


def main() -> None:
    """Runs the node."""
    run_node("haptic_node", HapticNode, HapticNode.run)
