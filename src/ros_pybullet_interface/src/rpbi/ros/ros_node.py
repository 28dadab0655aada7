"""rospy in one object, for scripts written in that manner."""

from __future__ import annotations

from typing import Any

import rospy

from custom_ros_tools.tf import TfInterface


class RosNode:
    """A node, its TF, and what scripts use of rospy, under the same names unless said otherwise.

    The simulator does not use it: it must never wait for ROS time, and this does.

    Args:
        name: Name of the node.

    Attributes:
        tf: TF.
    """

    Time = rospy.Time
    Duration = rospy.Duration
    Rate = rospy.Rate
    Timer = rospy.Timer
    Publisher = rospy.Publisher
    Subscriber = rospy.Subscriber
    Service = rospy.Service
    ServiceProxy = rospy.ServiceProxy

    on_shutdown = staticmethod(rospy.on_shutdown)
    sleep = staticmethod(rospy.sleep)
    spin = staticmethod(rospy.spin)
    wait_for_service = staticmethod(rospy.wait_for_service)
    wait_for_message = staticmethod(rospy.wait_for_message)
    set_param = staticmethod(rospy.set_param)
    get_param = staticmethod(rospy.get_param)
    logdebug = staticmethod(rospy.logdebug)
    loginfo = staticmethod(rospy.loginfo)
    logwarn = staticmethod(rospy.logwarn)
    logerr = staticmethod(rospy.logerr)
    logfatal = staticmethod(rospy.logfatal)

    def __init__(self, name: str) -> None:
        rospy.init_node(name)
        self.tf = TfInterface()

    @staticmethod
    def time_now() -> rospy.Time:
        """Returns the present ROS time (`rospy.Time.now`)."""
        return rospy.Time.now()

    def wait_for_tf(self, parent: str, child: str, timeout: float | None = None) -> Any:
        """Waits for a transform and returns position and quaternion; see `TfInterface.wait_for_tf`."""
        return self.tf.wait_for_tf(parent, child, timeout)
