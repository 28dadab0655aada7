"""The node `resettable_static_transform_publisher`: publishes a fixed transform, which a service can replace."""

import sys

import rospy
from custom_srvs.srv import SetTransform, SetTransformRequest, SetTransformResponse

from custom_ros_tools.errors import collecting_problems
from custom_ros_tools.node_configs import RateParameters
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import WallTimer
from custom_ros_tools.transforms import StaticTransform

from .transform_messages import TransformTopic, position_in, quat_in, transform_message

NAME = "resettable_static_transform_publisher"


class StaticTransformNode:
    """Publishes a transform on /tf at a fixed rate. The service `reset_tf` replaces the transform.

    Raises:
        ConfigError: If arguments or parameters are invalid.
    """

    def __init__(self) -> None:
        with collecting_problems() as part:
            with part():
                given = StaticTransform.from_arguments(rospy.myargv(sys.argv)[1:])
            with part():
                rate = private_parameters(RateParameters)
        self._transform = transform_message(given.position, given.quat_xyzw)
        self._topic = TransformTopic(given.parent, given.child)
        rospy.Service("reset_tf", SetTransform, self._reset)
        WallTimer(rate.hz, lambda: self._topic.send(self._transform))

    def _reset(self, request: SetTransformRequest) -> SetTransformResponse:
        try:
            self._transform = transform_message(position_in(request.transform), quat_in(request.transform))
        except ValueError as error:
            return SetTransformResponse(False, f"transform refused: {error}")
        return SetTransformResponse(True, "transform set")


def main() -> None:
    """Runs the node."""
    run_node(NAME, StaticTransformNode)
