#!/usr/bin/python3
"""Client as in the authors' release: goes to where EXOTica finds the start of the figure, and has it tracked."""

import sys

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool

from custom_ros_tools.ros_comm import get_srv_handler
from custom_ros_tools.tf import TfInterface
from ik_ros.msg import EXOTicaProblem, EXOTicaSyncTf
from ik_ros.srv import EXOTica, EXOTicaInfo
from ros_pybullet_interface.srv import ResetJointState

rospy.init_node("run_example")
plugin, robot = rospy.myargv(sys.argv)[1], rospy.get_param("~robot_name")
tf = TfInterface()
move = get_srv_handler(f"rpbi/{robot}/move_to_joint_state", ResetJointState)
solve = get_srv_handler(f"ik/solver/{plugin}/solve", EXOTica)
toggles = [
    get_srv_handler(name, SetBool)
    for name in (f"ik/setup/{plugin}/toggle", f"ik/solver/{plugin}/toggle", "toggle_figure_eight")
]
info = get_srv_handler("exotica_info", EXOTicaInfo)()
state = rospy.wait_for_message(f"rpbi/{robot}/joint_states", JointState)
problem = EXOTicaProblem(
    task_map_names=info.task_map_names,
    task_map_goals=[Float64MultiArray(data=[0.0] * count) for count in info.task_map_nrho],
    start_state=state,
    previous_solutions=[state],
)
for line in rospy.get_param("ik_setup/sync_tf_to_exotica_object"):
    tf_parent, tf_child, exo_parent, exo_child = line.split(" ")
    position, quat = tf.wait_for_tf(tf_parent, f"{tf_child}_base")
    pose = [*position.tolist(), *quat.tolist()]
    problem.sync_tf.append(EXOTicaSyncTf(tf_parent, tf_child, exo_parent.strip("'"), exo_child, pose))
answer = solve(problem)
assert answer.success, answer.message
assert move(answer.solution, 5.0).success
for toggle in toggles:
    toggle(True)
