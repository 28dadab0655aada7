"""Input of the haptic loop from ROS: force and position of the tool."""

import math

import rospy
import tf2_ros
from geometry_msgs.msg import WrenchStamped

from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.tf_listener import TfListener
from custom_ros_tools.ros.transform_messages import position_in, quat_in
from operator_node.haptics.node_config import HapticNodeConfig
from operator_node.haptics.process.client import LoopClient
from robot_model.geometry import Pose, Quaternion, minus, rotated

TOOL_HZ = 500.0
"""Rate at which TF is queried for the tool."""
LOOK_HZ = 50.0
"""Rate at which TF is queried for the orientation of the sensor."""
TF_CACHE_S = 2.0
NO_ROTATION: Quaternion = (0.0, 0.0, 0.0, 1.0)


class ToolFeed:
    """Sends forces on `haptics/wrench` and poses from TF to the loop.

    Attributes:
        start: Initial pose of the tool, where the target starts; None until TF has it.
    """

    def __init__(self, config: HapticNodeConfig, loop: LoopClient) -> None:
        self._config, self._loop = config, loop
        self._warn = ThrottledWarning()
        self.start: Pose | None = None
        self._stamp: rospy.Time | None = None
        self._frame = ""
        self._rotation: Quaternion | None = NO_ROTATION
        self._buffer = tf2_ros.Buffer(rospy.Duration.from_sec(TF_CACHE_S), debug=False)
        self._listener = TfListener(self._buffer)
        rospy.Subscriber("haptics/wrench", WrenchStamped, self._on_wrench, queue_size=1, tcp_nodelay=True)
        WallTimer(LOOK_HZ, self._look)
        if config.mode == "coupling":
            WallTimer(TOOL_HZ, self._observe_tool)

    def _on_wrench(self, message: WrenchStamped) -> None:
        """Sends the force on the tool to the loop."""
        f = message.wrench.force
        if not math.isfinite(f.x + f.y + f.z):
            self._warn("haptics/wrench", f"refused, expected finite numbers, got {f.x:g}, {f.y:g}, {f.z:g}")
            return
        if message.header.frame_id != self._frame:
            self._frame, self._rotation = message.header.frame_id, None if message.header.frame_id else NO_ROTATION
            self._look_up_sensor()
        if (rotation := self._rotation) is not None:
            self._loop.observe_wrench(rotated(rotation, (f.x, f.y, f.z)), _age_s(message.header.stamp))

    def _look(self) -> None:
        if self.start is None and (found := self._tool()) is not None:
            self.start, _ = found
        self._look_up_sensor()

    def _look_up_sensor(self) -> None:
        """Looks up the orientation of the force's frame in TF."""
        frame = self._frame.strip("/")
        if not frame:
            return
        try:
            found = self._buffer.lookup_transform(self._config.parent_frame_id, frame, rospy.Time(0))
            x, y, z, w = quat_in(found.transform).tolist()
            self._rotation = x, y, z, w
        except (tf2_ros.TransformException, ValueError) as error:
            self._warn("haptics/wrench", f"refused, since its frame '{frame}' is not known: {error}")

    def _tool(self) -> tuple[Pose, rospy.Time] | None:
        """Returns pose and stamp of the tool, None while TF does not have it."""
        frame = self._config.tool_frame_id
        if frame is None:
            return Pose(), rospy.Time(0)
        try:
            found = self._buffer.lookup_transform(self._config.parent_frame_id, frame, rospy.Time(0))
            x, y, z = position_in(found.transform).tolist()
            qx, qy, qz, qw = quat_in(found.transform).tolist()
            return Pose((x, y, z), (qx, qy, qz, qw)), found.header.stamp
        except tf2_ros.TransformException:
            return None
        except ValueError as error:
            self._warn(f"TF of '{frame}'", f"refused: {error}")
            return None

    def _observe_tool(self) -> None:
        """Sends the position of the tool to the loop, if TF has a new one."""
        if self.start is None or (found := self._tool()) is None:
            return
        tool, stamp = found
        if stamp == self._stamp:
            return
        self._stamp = stamp
        self._loop.observe_tool(minus(tool.position, self.start.position), _age_s(stamp))


def _age_s(stamp: rospy.Time) -> float:
    """Returns the age of a stamp [s]; 0 without one."""
    return max((rospy.Time.now() - stamp).to_sec(), 0.0) if stamp else 0.0
