"""`ik_solver_node.py`: problems in, joint targets out, and failures told with their reason."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, Transform, Vector3
from ik_nodes import (
    BENT,
    FAR,
    HOME,
    JOINTS,
    TIP,
    forward,
    problem,
    send_until,
    start_at,
    start_node,
    start_solver,
    static_transform,
)
from node_world import Rosout, publishing
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from ik_ros.msg import IKProblem, IKSolution, TracIKProblem
from ik_ros.srv import JointNames, SolveIK, TracIK


def assert_position(positions, pose):
    """Checks that the tip is where a pose is, in whatever orientation."""
    a, b = forward(positions).position, pose.position
    assert math.dist((a.x, a.y, a.z), (b.x, b.y, b.z)) < 1e-3


def assert_there(positions, pose):
    """Checks that the tip is at a pose."""
    assert_position(positions, pose)
    reached = forward(positions)
    a, b = reached.orientation, pose.orientation
    assert abs(a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w) > math.cos(0.005)


@pytest.mark.parametrize("solver", ["kdl", "pybullet", "trac_ik", "global"])
def test_problems_become_targets_that_reach(ros, solver):
    start_solver(ros, solver)
    targets, solutions = ros.listen("joint_states/target", JointState), ros.listen("ik/solution", IKSolution)
    asked = problem(BENT, start=start_at(HOME))
    asked.header.stamp = rospy.Time(12, 5)
    with publishing("ik", IKProblem) as ik:
        target = send_until(ik, asked, targets)
        solution = wait_until(
            lambda: next((each for each in list(solutions.messages) if each.success), None), "a solution comes"
        )
    assert list(target.name) == JOINTS == list(solution.joint_names)
    assert_there(target.position, asked.target)
    assert (solution.success, solution.interface_name) == (True, solver)
    assert solution.header.stamp == target.header.stamp == rospy.Time(12, 5)
    assert TIP in solution.message


@pytest.mark.quick
def test_problems_of_the_release_work_by_topic_and_service(ros):
    start_solver(ros, "trac_ik", timeout=5.0)
    targets = ros.listen("joint_states/target", JointState)
    pose = forward(BENT)
    translation = Vector3(pose.position.x, pose.position.y, pose.position.z)
    old = TracIKProblem(qinit=start_at(HOME), goal=Transform(translation, pose.orientation), bx=1e-5, brx=1e-3)
    with publishing("ik", TracIKProblem) as ik:
        assert_there(send_until(ik, old, targets).position, pose)
    old.qinit.position = BENT
    old.goal.rotation = Quaternion(0.0, 0.0, 0.0, 1.0)
    old.brx = old.bry = old.brz = 10.0
    for service in ("solve", "solve_trac_ik"):
        answer = ros.call(f"ik/solver/trac_ik/{service}", TracIK, old)
        assert answer.success, answer.message
        assert_position(answer.solution.position, pose)
    answer = ros.call("ik/solver/trac_ik/solve_ik", SolveIK, problem(BENT, start=start_at(HOME)))
    assert answer.success, answer.message
    assert_there(answer.solution.position, pose)


def test_service_answers_whether_the_node_is_on_or_off(ros):
    start_solver(ros, start_on_init=False)
    answer = ros.call("ik/solver/kdl/solve", SolveIK, problem(BENT))
    assert answer.success, answer.message
    assert_there(answer.solution.position, forward(BENT))
    assert answer.position_error < 1e-3 and answer.orientation_error < 0.01
    failed = ros.call("ik/solver/kdl/solve", SolveIK, IKProblem(has_target=True, target=FAR))
    assert not failed.success and failed.position_error > 1.0 and len(failed.solution.position) == 7
    refused = ros.call("ik/solver/kdl/solve", SolveIK, IKProblem())
    assert not refused.success and "target" in refused.message
    assert list(ros.call("ik/solver/kdl/joint_names", JointNames).joint_names) == JOINTS


def test_global_solver_returns_reaching_alternatives(ros):
    start_solver(ros, "global", start_on_init=False)
    answer = ros.call("ik/solver/global/solve", SolveIK, problem(BENT))
    assert answer.success and len(answer.alternatives) >= 1
    for alternative in answer.alternatives:
        assert_there(alternative.position, forward(BENT))
        assert np.abs(np.subtract(alternative.position, answer.solution.position)).max() > 0.05


def test_switched_off_it_does_not_listen(ros):
    start_solver(ros, start_on_init=False)
    solutions = ros.listen("ik/solution", IKSolution)
    toggle = "ik/solver/kdl/toggle"
    assert ros.call(toggle, SetBool, True).success
    with publishing("ik", IKProblem) as ik:
        send_until(ik, problem(BENT), solutions)
        assert ros.call(toggle, SetBool, False).success
        wait_until(lambda: not ik.get_num_connections(), "it listens no more")
    assert not ros.call(toggle, SetBool, False).success, "it is off already"


def test_poses_of_other_frames_are_turned_into_the_base(ros):
    base_in_world = Pose(Point(1.0, 2.0, 0.0), Quaternion(0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)))
    start_solver(ros, base_frame_id="foot")
    p = forward(BENT)
    # A quarter turn about z takes x, y to -y, x
    q, half = p.orientation, math.sqrt(0.5)
    turned = Quaternion(half * (q.x - q.y), half * (q.y + q.x), half * (q.z + q.w), half * (q.w - q.z))
    asked = IKProblem(has_target=True, target=Pose(Point(1 - p.position.y, 2 + p.position.x, p.position.z), turned))
    asked.header.frame_id = "room"

    def solution():
        answer = ros.call("ik/solver/kdl/solve", SolveIK, asked)
        return answer if answer.success else None

    with static_transform("room", "foot", base_in_world):
        assert_there(wait_until(solution, "TF is known and it is solved").solution.position, p)
    asked.header.frame_id = "nowhere"
    refused = ros.call("ik/solver/kdl/solve", SolveIK, asked)
    assert not refused.success and "'nowhere'" in refused.message and "'foot'" in refused.message


def test_continuity_obeys_joint_velocities_and_holds_unreachable_targets(ros):
    start_solver(ros, continuity={"max_velocity": 0.5, "hold": True})
    targets = ros.listen("joint_states/target", JointState)
    solutions = ros.listen("ik/solution", IKSolution)
    far_away = np.add(HOME, 0.4)
    with publishing("ik", IKProblem) as ik:
        wait_until(lambda: targets.is_connected and solutions.is_connected, "answers would be heard")
        for number in range(120):
            asked = problem_at(far_away)
            asked.header.stamp = rospy.Time(100) + rospy.Duration.from_sec(0.01 * number)
            ik.publish(asked)
            targets.wait_for(number + 1)
        ik.publish(IKProblem(header=Header(stamp=rospy.Time(200)), has_target=True, target=FAR))
        held = targets.wait_for(121)[-1]
    assert held.header.stamp == rospy.Time(200) and list(held.name) == JOINTS
    assert held.position == targets.messages[-2].position
    positions = np.array([message.position for message in targets.messages])
    assert np.abs(np.diff(positions, axis=0)).max() <= 0.5 * 0.01 + 1e-9
    assert_there(positions[-1], forward(far_away))
    assert any("of the motion to it" in solution.message for solution in solutions.messages)


def test_targets_start_at_the_robot_despite_earlier_unheard_ones(ros):
    """A guard that starts late would halt at a target that is away from the robot."""
    start_solver(ros, continuity={"max_velocity": 0.5, "hold": True})
    asked = problem_at(np.add(HOME, 0.4))
    with publishing("ik", IKProblem) as ik:
        for number in range(50):
            asked.header.stamp = rospy.Time(100) + rospy.Duration.from_sec(0.01 * number)
            ik.publish(asked)
        ros.call("ik/solver/kdl/solve_ik", SolveIK, asked)  # it is served after some of them, if not all
        targets = ros.listen("joint_states/target", JointState)
        wait_until(lambda: targets.is_connected, "targets would be received")
        asked.header.stamp = rospy.Time(101)
        first = send_until(ik, asked, targets)
    assert first.position == pytest.approx(HOME)


_POSES = {}


def problem_at(positions):
    """Returns a problem that starts at home, its pose computed once."""
    key = tuple(positions)
    _POSES.setdefault(key, forward(positions))
    return IKProblem(has_target=True, target=_POSES[key], start=start_at(HOME))


@pytest.mark.parametrize(
    ("solver", "parameters", "told"),
    [
        ("kdk", {}, "did you mean 'kdl'?"),
        ("kdl", {"tip_link": "finger"}, "tip_link: unknown link 'finger'"),
        ("kdl", {"urdf_filename": "/nowhere.urdf"}, "urdf_filename"),
        ("kdl", {"tip": "x"}, "tip: unknown key"),
        ("kdl", {"continuity": {"max_velocity": -1.0}}, "continuity.max_velocity"),
        ("kdl", {"continuity": {"max_velocity": {"elbow": 1.0}}}, "no joint is called elbow"),
        ("nowhere.solvers:Best", {}, "nowhere"),
    ],
    ids=["solver", "link", "file", "key", "velocity", "joint", "module"],
)
def test_wrong_parameters_end_it_with_1_and_their_names(ros, solver, parameters, told):
    rospy.set_param("/ik_solver_node", {**dict(CHAIN_OF_TEST), **parameters})
    process = ros.start(["rosrun", "ik_ros", "ik_solver_node.py", solver, "__name:=ik_solver_node"])
    assert process.wait(60.0) == 1
    output = ros.output(process)
    assert told in output, output
    assert "Traceback" not in output


def test_missing_solver_argument_is_answered_with_known_names(ros):
    process = ros.start(["rosrun", "ik_ros", "ik_solver_node.py"])
    assert process.wait(60.0) == 2
    assert "kdl" in ros.output(process) and "trac_ik" in ros.output(process)


CHAIN_OF_TEST = {
    "urdf_filename": "{rpbi_examples}/robots/kuka_lwr.urdf",
    "base_link": "lwr_arm_0_link",
    "tip_link": TIP,
}


@pytest.fixture
def lazy_lab(tmp_path, monkeypatch):
    """Makes a package of a user's known to the nodes; returns its folder."""
    (tmp_path / "lazy_lab.py").write_text(OWN_SOLVER)
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}")
    return tmp_path


def test_switched_off_solver_publishes_no_result_of_its_running_problem(ros, lazy_lab):
    begun, over = lazy_lab / "begun", lazy_lab / "over"
    parameters = {"position": 0.25, "begun": str(begun), "over": str(over), "start_on_init": True}
    start_node(ros, "ik_solver_node.py", "lazy_lab:Stubborn", "ik/solver/lazy_lab/Stubborn/solve", **parameters)
    targets, solutions = ros.listen("joint_states/target", JointState), ros.listen("ik/solution", IKSolution)
    with publishing("ik", IKProblem) as ik:
        wait_until(lambda: targets.is_connected and solutions.is_connected, "answers would be heard")
        wait_until(lambda: ik.publish(IKProblem()) or begun.exists(), "it is at work")
        assert ros.call("ik/solver/lazy_lab/Stubborn/toggle", SetBool, False).success
        over.touch()
    for _ in range(2):  # they wait for what it is about, so it is over then
        assert ros.call("ik/solver/lazy_lab/Stubborn/solve", SolveIK, IKProblem()).success
    assert targets.messages == solutions.messages == []


def test_start_outside_limits_is_warned_of(ros):
    rosout = Rosout(ros)
    start_solver(ros, start_on_init=False)
    answer = ros.call("ik/solver/kdl/solve", SolveIK, problem(BENT, start=start_at((9.0, *HOME[1:]))))
    assert answer.success
    wait_until(lambda: rosout.logs("the start is outside limits"), "it is warned of")


def test_users_own_solver_serves_by_module_and_class(ros, lazy_lab):
    start_node(ros, "ik_solver_node.py", "lazy_lab:Stubborn", "ik/solver/lazy_lab/Stubborn/solve", position=0.25)
    answer = ros.call("ik/solver/lazy_lab/Stubborn/solve", SolveIK, IKProblem())
    assert answer.success and answer.solution.name == ["joint"] and answer.solution.position == (0.25,)


OWN_SOLVER = """
import time
from pathlib import Path

from custom_ros_tools.schema import ConfigModel
from ik_ros.problem import IKSolution
from ik_ros.solver import Solver


class StubbornConfig(ConfigModel):
    position: float
    begun: str = ""
    over: str = ""


class Stubborn(Solver):
    Config = StubbornConfig
    deterministic = True
    joint_names, lower, upper, velocity_limits, base_frame = ("joint",), (-1.0,), (1.0,), (1.0,), "base"

    def __init__(self, config):
        self._position, self._begun, self._over = config.position, config.begun, config.over

    def solve(self, problem):
        if self._begun:
            Path(self._begun).touch()
        while self._over and not Path(self._over).exists():
            time.sleep(0.01)
        return IKSolution(True, "as always", self.joint_names, (self._position,))
"""
