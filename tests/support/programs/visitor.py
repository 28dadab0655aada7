"""A client of a world with an iiwa: moves a joint, sleeps in ROS time, stops the world and steps it."""

from __future__ import annotations

import rospy
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

JOINT = "lbr_iiwa_joint_4"
GOAL = 0.3
TARGET = JointState(name=[JOINT], position=[GOAL])
here: list[float] = []


def _take(message: JointState) -> None:
    here[:] = [message.position[message.name.index(JOINT)]]


rospy.init_node("visitor", anonymous=True)
publisher = rospy.Publisher("rpbi/iiwa/joint_states/target", JointState, queue_size=1)
subscriber = rospy.Subscriber("rpbi/iiwa/joint_states", JointState, _take)
while not here or abs(here[0] - GOAL) > 0.01:
    publisher.publish(TARGET)
    rospy.rostime.wallsleep(0.05)
print("moved", flush=True)
rospy.sleep(0.1)
print("slept until", rospy.Time.now().to_sec(), flush=True)
for name in ("stop", "step"):
    print(rospy.ServiceProxy(f"rpbi/{name}", Trigger)().message, flush=True)
