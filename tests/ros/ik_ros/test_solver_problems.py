"""What one `ik_solver_node.py` makes of problems without an answer, without sense or of another type."""

from __future__ import annotations

import math

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from ik_nodes import BENT, FAR, JOINTS, answers, problem, send_until, start_at, start_solver
from node_world import Rosout, publishing
from ros_system import wait_until
from sensor_msgs.msg import JointState

from ik_ros.msg import IKProblem, IKSolution


@pytest.fixture(scope="module")
def kdl(module_ros):
    """The node, switched on."""
    return start_solver(module_ros)


def test_unsolvable_problem_is_reported_with_reason_and_moves_nothing(ros, kdl):
    rosout = Rosout(ros)
    targets, solutions = ros.listen("joint_states/target", JointState), ros.listen("ik/solution", IKSolution)
    with publishing("ik", IKProblem) as ik:
        asked = IKProblem(has_target=True, target=FAR)
        solution = send_until(ik, asked, solutions, 3)
        wait_until(lambda: rosout.logs("misses its target"), "it is warned of")
    assert not solution.success and "misses its target" in solution.message
    assert len(solution.solution) == 7, "the best that was found"
    assert answers(targets, asked) == []
    assert rosout.is_throttled("misses its target"), "once, not each time"


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (IKProblem(), "target"),
        (IKProblem(has_target=True, target=Pose(Point(math.nan, 0, 0), Quaternion(0, 0, 0, 1))), "finite"),
        (IKProblem(has_target=True, target=Pose(Point(), Quaternion())), "quaternion: must not be zero"),
        (problem(start=JointState(name=["elbow"], position=[0.1])), "unknown joint 'elbow'"),
        (problem(start=JointState(name=JOINTS, position=[0.1])), "start: expected 7 values of position"),
        (problem(start=JointState(position=[0.1])), "start: expected the names"),
        (problem(position_tolerance=Vector3(-1.0, 0.0, 0.0)), "position_tolerance: must not be negative"),
    ],
    ids=["no target", "not a number", "no rotation", "unknown joint", "too few", "no names", "negative tolerance"],
)
def test_invalid_problem_is_refused_and_the_next_one_solved(ros, kdl, wrong, told):
    targets, solutions = ros.listen("joint_states/target", JointState), ros.listen("ik/solution", IKSolution)
    with publishing("ik", IKProblem) as ik:
        solution = send_until(ik, wrong, solutions)
        assert not solution.success and told in solution.message, solution.message
        assert answers(targets, wrong) == []
        send_until(ik, problem(BENT), targets)


def test_messages_of_another_type_are_refused_and_the_types_named(ros, kdl):
    rosout = Rosout(ros)
    with publishing("ik", JointState) as ik:
        wait_until(lambda: ik.publish(JointState()) or rosout.logs("ik_ros/IKProblem or"), "they are refused")
    assert "sensor_msgs/JointState" in rosout.logs("ik_ros/IKProblem or")[0].msg


def test_targets_continue_from_the_last_one_without_a_start(ros, kdl):
    targets = ros.listen("joint_states/target", JointState)
    with publishing("ik", IKProblem) as ik:
        send_until(ik, problem(BENT, start=start_at(BENT)), targets)
        near = np.add(BENT, 0.01)
        asked = problem(near)
        send_until(ik, asked, targets, 3)
        last = answers(targets, asked)[-1]
    assert np.abs(np.subtract(last.position, near)).max() < 0.1, "another posture would be further away"
