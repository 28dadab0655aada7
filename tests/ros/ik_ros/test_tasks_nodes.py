"""`ik_solver_node.py` with formulations of tasks and with trajectories, whose options are nested lists."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion
from ik_nodes import CHAIN, HOME, JOINTS, forward, start_at, start_node

from custom_ros_tools.config import load_config
from ik_ros.msg import IKProblem, TaskGoal, Waypoint
from ik_ros.srv import SolveIK

TALOS = Path(__file__).resolve().parents[3] / "src/rpbi_examples/configs/ik_talos/ik.yaml"
BENT = (0.3, 0.6, 0.2, -1.2, 0.1, 0.8, 0.4)


@pytest.mark.quick
def test_talos_reaches_with_its_formulation_from_parameters(ros):
    start_node(ros, "ik_solver_node.py", "tasks", "ik/solver/tasks/solve", **load_config(str(TALOS)))
    solve = rospy.ServiceProxy("ik/solver/tasks/solve", SolveIK)
    target = Pose(Point(0.6, 0.1, 0.7), Quaternion(0.0, 0.0, 0.0, 1.0))
    problem = IKProblem(has_target=True, target=target, goals=[TaskGoal("look", (0.6, 0.1, 0.7))])
    answer = solve(problem)
    assert answer.success, answer.message
    assert "leg_left_4_joint" in answer.solution.name
    problem.goals[0].task = "lok"
    answer = solve(problem)
    assert not answer.success and "unknown task 'lok'" in answer.message and "did you mean 'look'" in answer.message


def test_trajectories_are_answered(ros):
    start_node(ros, "ik_solver_node.py", "trajectory", "ik/solver/trajectory/solve", **CHAIN)
    solve = rospy.ServiceProxy("ik/solver/trajectory/solve", SolveIK)
    waypoint = Waypoint(rospy.Duration(2), forward(BENT))
    answer = solve(IKProblem(start=start_at(HOME), waypoints=[waypoint]))
    assert answer.success, answer.message
    assert answer.trajectory.joint_names == JOINTS
    last = answer.trajectory.points[-1]
    assert last.time_from_start == rospy.Duration(2)
    a, b = forward(last.positions).position, waypoint.pose.position
    assert math.dist((a.x, a.y, a.z), (b.x, b.y, b.z)) < 1e-3
