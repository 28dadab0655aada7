"""A controller: pushes the parcel off the belt when the range finder sees it, and puts it back on request."""

import rospy
from custom_srvs.srv import SetTransform
from geometry_msgs.msg import Quaternion, Transform, Vector3
from sensor_msgs.msg import JointState, Range
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from custom_ros_tools.ros.lifecycle.run_node import run_node

OUT, HOME = 0.5, 0.0
"""Where the plate goes [m]."""
NEAR = 0.01
"""How near is there [m]."""
START = Transform(Vector3(-0.8, 0.0, 0.56), Quaternion(0.0, 0.0, 0.0, 1.0))
"""Where parcels come onto the belt [m], in `rpbi/world`."""


class Pusher:
    """Hears a range finder and the robot's joint, and tells the joint where to go."""

    def __init__(self) -> None:
        self._position = HOME
        self._target = rospy.Publisher("rpbi/pusher/joint_states/target", JointState, queue_size=10)
        self._put_parcel = rospy.ServiceProxy("rpbi/parcel/set_pose", SetTransform)
        rospy.Subscriber("rpbi/pusher/joint_states", JointState, self._feel)
        rospy.Subscriber("rpbi/belt/end/range", Range, self._see)
        rospy.Service("next_parcel", Trigger, self._next_parcel)

    def _feel(self, message: JointState) -> None:
        self._position = message.position[message.name.index("slide")]
        if self._position > OUT - NEAR:
            self._go(HOME)

    def _see(self, message: Range) -> None:
        is_home = self._position < HOME + NEAR
        if is_home and message.range <= message.max_range:
            rospy.loginfo_throttle(1.0, f"a parcel at {message.range:.2f} m: pushing")
            self._go(OUT)

    def _next_parcel(self, _: TriggerRequest) -> TriggerResponse:
        answer = self._put_parcel(START)
        return TriggerResponse(answer.success, answer.message)

    def _go(self, position: float) -> None:
        self._target.publish(JointState(name=["slide"], position=[position]))


def main() -> None:
    """Runs the node."""
    run_node("pusher", Pusher)
