"""The class `RosNode`, which scripts for the original ros_pybullet_interface use."""

from typing import Any

import rospy

from custom_ros_tools.ros.lifecycle.run_node import leave_ros_on_signals
from custom_ros_tools.tf import TfInterface


class RosNode:
    """Initialises a ROS node and offers all attributes of rospy, such as `Publisher`, `Rate` and `loginfo`.

    The simulator does not use this class: the class waits for ROS time, which the simulator itself publishes.

    Args:
        name: The node's name, unless it is remapped.
        options: Options of `rospy.init_node`, such as `anonymous` and `log_level`. With `disable_signals`, the script
            handles Ctrl-C itself.

    Attributes:
        tf: Listens to TF and broadcasts transforms.
    """

    def __init__(self, name: str, **options: Any) -> None:
        rospy.init_node(name, **{**options, "disable_signals": True})
        if not options.get("disable_signals"):
            leave_ros_on_signals()
        self.tf = TfInterface()

    def __getattr__(self, name: str) -> Any:
        return getattr(rospy, name)

    @staticmethod
    def time_now() -> rospy.Time:
        """Returns the present ROS time (`rospy.Time.now`)."""
        return rospy.Time.now()

    def wait_for_tf(self, parent_frame_id: str, child_frame_id: str, timeout: float | None = None) -> Any:
        """Waits for a transform and returns position and quaternion; see `TfInterface.wait_for_tf`."""
        return self.tf.wait_for_tf(parent_frame_id, child_frame_id, timeout)
