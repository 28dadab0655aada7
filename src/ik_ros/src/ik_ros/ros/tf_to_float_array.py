"""`tf_to_floatarray_node.py`: publishes a transform as an array of numbers, for example as the goal of a task."""

import rospy
from std_msgs.msg import Float64MultiArray

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.transforms import rpy_of
from ik_ros.node_configs import TfToFloatArrayConfig

from .tf import FreshTf

QUEUE_SIZE = 10


class TfToFloatArrayNode:
    """Publishes a transform on the topic `transform` at a fixed rate, while the transform in TF is recent.

    Raises:
        ConfigError: If a parameter is invalid.
    """

    def __init__(self) -> None:
        config = private_parameters(TfToFloatArrayConfig)
        self._mode = config.mode
        self._tf = FreshTf(config.parent_frame_id, config.child_frame_id, config.tf_timeout_s)
        self._warn = ThrottledWarning()
        self._publisher = rospy.Publisher("transform", Float64MultiArray, queue_size=QUEUE_SIZE)
        WallTimer(config.hz, self._publish)

    def _publish(self) -> None:
        try:
            position, quat_xyzw = self._tf.pose()
        except InterfaceError as error:
            self._warn("nothing is published", str(error))
            return
        rotation = {"pos": (), "pos+quat": quat_xyzw, "pos+eul": tuple(rpy_of(quat_xyzw))}[self._mode]
        self._publisher.publish(Float64MultiArray(data=[*position, *rotation]))


def main() -> None:
    """Runs the node."""
    run_node("tf_to_floatarray", TfToFloatArrayNode, anonymous=True)
