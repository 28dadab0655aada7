"""A planner's part, in its own process: sends a goal and prints how it ended. Arguments: seconds, then positions."""

import sys

import actionlib
import rospy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from trajectory_world import CONTROLLER, trajectory

rospy.init_node("planner")
client = actionlib.SimpleActionClient(f"{CONTROLLER}/follow_joint_trajectory", FollowJointTrajectoryAction)
client.wait_for_server()
duration_s, *positions = map(float, sys.argv[1:])
begin = rospy.Time.now()
client.send_goal_and_wait(FollowJointTrajectoryGoal(trajectory=trajectory((duration_s, positions))))
took_s = (rospy.Time.now() - begin).to_sec()
print(f"state {client.get_state()}, code {client.get_result().error_code}, took {took_s:g}", flush=True)
