"""The default solver: limits, starts, tolerances, unusual joints."""

from __future__ import annotations

import logging
import math
import random
from pathlib import Path

import pytest
from planar_arm import LIMITED, planar_arm

from custom_ros_tools.errors import ConfigError, UnknownNameError
from ik_ros.chain.kdl import Goal
from ik_ros.conformance import distances, random_quat
from ik_ros.lookup import make_solver
from ik_ros.problem import IKProblem
from robot_model.geometry import Pose

LWR = Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf"
ELBOW = [0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0]


@pytest.fixture
def lwr():
    options = {"urdf_filename": str(LWR), "base_link": "lwr_arm_0_link", "tip_link": "end_effector_ball"}
    return make_solver("kdl", options)


def _start(solver, positions=ELBOW):
    return dict(zip(solver.joint_names, positions))


def _turned_about_z(angle):
    return (0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2))


def test_a_robot_that_is_there_stays(lwr):
    solution = lwr.solve(IKProblem(target=lwr.chain.pose(ELBOW), start=_start(lwr)))
    assert solution.success
    assert solution.positions == pytest.approx(ELBOW, abs=1e-4)
    assert "'end_effector_ball' is within" in solution.message


def test_answers_are_exact_where_joints_can_move_on(lwr):
    random.seed(4)
    for _ in range(300):
        inside = [random.uniform(0.9 * low, 0.9 * high) for low, high in zip(lwr.lower, lwr.upper)]
        solution = lwr.solve(IKProblem(target=lwr.chain.pose(inside)))
        assert solution.success
        assert solution.position_error_m < 2e-5 and solution.orientation_error_rad < 2e-4


def test_a_path_is_followed_without_jumps_along_a_limit_too(lwr):
    """The last joint runs into its limit, beyond which KDL alone would go on: the others make up for it."""
    posture = [0.3, 0.5, 0.2, -1.2, 0.4, 0.8, 2.95]
    x, y, z = lwr.chain.pose(posture).position
    quat_xyzw = lwr.chain.pose(posture).quat_xyzw
    q, largest, highest = posture, 0.0, 0.0
    for i in range(400):
        angle = 2.0 * math.pi * i / 400
        target = Pose((x + 0.1 * math.sin(angle), y + 0.1 * math.sin(2.0 * angle), z), quat_xyzw)
        solution = lwr.solve(IKProblem(target=target, start=_start(lwr, q)))
        assert solution.success, solution.message
        largest = max(largest, *(abs(a - b) for a, b in zip(solution.positions, q)))
        highest = max(highest, solution.positions[6])
        q = solution.positions
    assert largest < 0.1
    assert highest > 2.96, "it did not get to the limit"


def test_start_outside_limits_is_moved_inside_and_reported_once(lwr, caplog):
    with caplog.at_level(logging.WARNING, "ik_ros"):
        for position in (5.0, 5.0, 0.5, 5.0):
            start = _start(lwr, [0.0, position, 0.0, -1.2, 0.0, 0.8, 2.96700001])
            lwr.solve(IKProblem(target=Pose((0.0, 0.0, 100.0)), start=start))
    assert [record.getMessage() for record in caplog.records] == [
        "the start is outside limits and is moved within them: 'lwr_arm_1_joint' 5"
    ], "once for a stream, and rounding of a limit is not worth a word"


def test_start_may_contain_robot_joints_outside_the_chain(lwr):
    wrist = make_solver("kdl", {"urdf_filename": str(LWR), "base_link": "lwr_arm_3_link", "tip_link": "lwr_arm_7_link"})
    assert wrist.joint_names == tuple(f"lwr_arm_{index}_joint" for index in range(3, 7))
    target = wrist.chain.pose([0.1, 0.2, 0.3, 0.4])
    assert wrist.solve(IKProblem(target=target, start=_start(lwr))).success
    with pytest.raises(UnknownNameError, match="unknown joint 'elbow': known are lwr_arm_3_joint, "):
        wrist.solve(IKProblem(target=target, start={"elbow": 1.0}))


def test_joints_without_a_start_begin_in_the_middle(lwr):
    target = lwr.chain.pose(ELBOW)
    assert lwr.solve(IKProblem(target=target)) == lwr.solve(IKProblem(target=target, start=_start(lwr, [0.0] * 7)))


@pytest.mark.parametrize(
    ("restarts", "asked", "starts"),
    [
        (50, {}, 51),
        (50, {"position_tolerance": (0.1, 0.0, 0.0)}, 16),
        (50, {"target": Pose((0.0, 0.0, 100.0))}, 4),
        (1, {"target": Pose((0.0, 0.0, 100.0))}, 2),
        (50, {"target": Pose((1.1, 0.0, 0.31))}, 10),
    ],
)
def test_fewer_restarts_are_made_where_slow_or_useless(lwr, restarts, asked, starts):
    problem = IKProblem(**{"target": lwr.chain.pose(ELBOW), **asked})
    far = [-2.0, -1.0, 2.0, 1.0, 2.0, -1.0, 2.0]
    assert len(list(lwr.candidates(problem, Goal(problem), far, restarts))) == starts


def test_a_problem_without_target_is_refused(lwr):
    with pytest.raises(ValueError, match="target: missing; this solver moves one link to a pose"):
        lwr.solve(IKProblem(start=_start(lwr)))


def test_unreachable_target_is_reported_and_the_arm_stretches_towards_it(lwr):
    target = Pose((3.0, 0.0, 0.31))
    solution = lwr.solve(IKProblem(target=target, rotation_tolerance=(4.0, 4.0, 4.0), start=_start(lwr)))
    assert not solution.success
    assert "misses the tolerances of its target by" in solution.message
    assert "1 mm would do; it is beyond the reach of the chain" in solution.message
    ways = [lwr.chain.pose([0.0, shoulder, *[0.0] * 5]) for shoulder in (-math.pi / 2, math.pi / 2)]
    stretched = max(pose.position[0] for pose in ways)
    assert solution.position_error_m <= 3.0 - stretched + 0.01


def test_other_seeds_may_lead_elsewhere_but_equal_ones_do_not(lwr):
    """From this start KDL ends beyond limits, so that random starts follow."""
    target = lwr.chain.pose([2.9, 1.9, -2.9, 1.9, 2.9, -1.9, 2.9])
    first, again, other = (lwr.solve(IKProblem(target=target, start=_start(lwr), seed=seed)) for seed in (1, 1, 2))
    assert first.success and other.success
    assert first == again
    assert first.positions != pytest.approx(other.positions, abs=0.1)


@pytest.mark.parametrize("free", ["x", "y", "z"])
def test_tolerance_of_pi_frees_rotation_about_that_axis_only(lwr, free):
    generator = random.Random(1)
    tolerance = tuple(4.0 if axis == free else 0.0 for axis in "xyz")
    solved = 0
    for _ in range(30):
        goal = lwr.chain.pose(lwr.limits.random(generator, lwr.limits.middle))
        spin = 4.0 * (generator.random() - 0.5)
        half = math.sin(spin / 2)
        quat_xyzw = (*(half if axis == free else 0.0 for axis in "xyz"), math.cos(spin / 2))
        target = goal @ Pose((0.0, 0.0, 0.0), quat_xyzw)
        solution = lwr.solve(IKProblem(target=target, rotation_tolerance=tolerance, start=_start(lwr)))
        if not solution.success:
            continue
        solved += 1
        off = target.inverse() @ lwr.chain.pose(solution.positions)
        assert math.hypot(*off.position) <= 1e-3
        axis = "xyz".index(free)
        others = [component for i, component in enumerate(off.quat_xyzw[:3]) if i != axis]
        assert 2.0 * math.hypot(*others) <= 0.0101, "turned about another axis"
    assert solved >= 29


def test_a_position_alone_is_reached_in_any_orientation(lwr):
    generator = random.Random(2)
    for _ in range(30):
        x, y, z = lwr.chain.pose(lwr.limits.random(generator, lwr.limits.middle)).position
        problem = IKProblem(
            target=Pose((x, y, z), random_quat(generator)), rotation_tolerance=(10.0, 10.0, 10.0), start=_start(lwr)
        )
        solution = lwr.solve(problem)
        assert solution.success, solution.message
        assert math.dist(lwr.chain.pose(solution.positions).position, (x, y, z)) <= 1e-3
        assert solution.orientation_error_rad == 0.0


def test_position_tolerances_are_along_the_axes_of_the_target(tmp_path):
    """The arm is 1 m long; the target is 1.2 m away and turned by 30 degrees."""
    arm = planar_arm(tmp_path)
    target = Pose((1.2, 0.0, 0.0), _turned_about_z(math.pi / 6))
    along = {"rotation_tolerance": (0.0, 0.0, 4.0), "start": {"elbow": 0.3}}
    too_little = arm.solve(IKProblem(target=target, position_tolerance=(0.1, 0.0, 0.0), **along))
    assert not too_little.success and too_little.position_error_m > 0.05
    enough = arm.solve(IKProblem(target=target, position_tolerance=(0.3, 0.0, 0.0), **along))
    assert enough.success, enough.message
    x, y, z = (target.inverse() @ arm.chain.pose(enough.positions)).position
    assert abs(x) <= 0.301 and abs(y) <= 1e-3 and abs(z) <= 1e-3
    assert x < -0.1, "it had to make use of the tolerance"


def test_joint_without_limits_takes_the_turn_nearest_to_the_start(tmp_path):
    arm = planar_arm(tmp_path, "continuous", "")
    assert math.isinf(arm.upper[2])
    target = arm.chain.pose([0.3, 1.0, 20.4])
    solution = arm.solve(IKProblem(target=target, start={"shoulder": 0.2, "elbow": 0.9, "wrist": 20.0}))
    assert solution.success
    assert solution.positions == pytest.approx((0.3, 1.0, 20.4), abs=1e-3)


def test_mimic_joint_follows_its_joint_and_is_not_solved_for(tmp_path):
    arm = planar_arm(tmp_path, more=LIMITED + '<mimic joint="elbow" multiplier="-2" offset="0.1"/>')
    assert arm.joint_names == ("shoulder", "elbow")
    assert (arm.lower[1], arm.upper[1]) == (pytest.approx(-1.45), pytest.approx(1.55)), "so that the wrist is within 3"
    for shoulder, elbow in ((0.4, 0.7), (-1.0, 1.2), (0.0, -0.5)):
        target = arm.chain.pose([shoulder, elbow])
        hand = shoulder + elbow - 2.0 * elbow + 0.1
        assert distances(Pose(target.position, _turned_about_z(hand)), target)[1] < 1e-6
        solution = arm.solve(IKProblem(target=target, start={"elbow": 0.2 * elbow, "wrist": 1.0}))
        assert solution.success, solution.message
        assert solution.positions == pytest.approx((shoulder, elbow), abs=0.01)


def test_a_chain_whose_leader_is_elsewhere_solves_for_the_leader(tmp_path):
    more = LIMITED + '<mimic joint="shoulder" multiplier="0.5"/>'
    hand = planar_arm(tmp_path, more=more, base="lower")
    assert hand.joint_names == ("shoulder",)
    solution = hand.solve(IKProblem(target=Pose((0.5, 0.0, 0.0), _turned_about_z(0.4))))
    assert solution.success and solution.positions == pytest.approx((0.8,), abs=0.02)


@pytest.mark.parametrize("solver", ["trac_ik", "pybullet"])
def test_solvers_that_cannot_solve_for_mimics_refuse_them(tmp_path, solver):
    with pytest.raises(ConfigError, match=f"planar.urdf: wrist: '{solver}' cannot solve for joints that mimic others"):
        planar_arm(tmp_path, more=LIMITED + '<mimic joint="elbow"/>', solver=solver)


@pytest.mark.parametrize(
    ("mimic", "message"),
    [
        ('<mimic joint="nobody"/>', "tip_link: .*joint 'wrist' mimics 'nobody', which is no joint that moves by"),
        ('<mimic joint="elbow" multiplier="0"/>', "joint 'wrist': mimic.multiplier: must not be 0"),
        ('<mimic joint="elbow" offset="9"/>', "joint 'wrist' leaves 'elbow', which it mimics, no position"),
    ],
)
def test_a_mimic_that_makes_no_sense_is_named(tmp_path, mimic, message):
    with pytest.raises(ConfigError, match=message):
        planar_arm(tmp_path, more=LIMITED + mimic)


@pytest.mark.parametrize("field", [{"position_tolerance": (0.0, 0.01, 0.0)}, {"rotation_tolerance": (0.0, 0.0, 1.0)}])
def test_pybullet_refuses_tolerances_that_it_cannot_make_use_of(tmp_path, field):
    arm = planar_arm(tmp_path, solver="pybullet")
    with pytest.raises(ValueError, match=f"{next(iter(field))}: 'pybullet' takes none above .*solver 'kdl'"):
        arm.solve(IKProblem(target=Pose((0.3, 0.3, 0.0)), **field))


@pytest.mark.parametrize(("solver", "options"), [("trac_ik", {"timeout": 5.0}), ("pybullet", {})])
def test_tolerances_below_the_default_are_accepted(tmp_path, solver, options):
    arm = planar_arm(tmp_path, solver=solver, **options)
    small = IKProblem(
        target=arm.chain.pose([0.3, 0.5, 0.2]), position_tolerance=(1e-5,) * 3, rotation_tolerance=(1e-3,) * 3
    )
    assert arm.solve(small).success


@pytest.mark.parametrize(
    "field",
    [{"rotation_tolerance": (10.0, 10.0, 10.0)}, {"position_tolerance": (0.3,) * 3}],
    ids=["any orientation", "a box"],
)
def test_trac_ik_solves_targets_with_tolerances_as_kdl_does(tmp_path, field):
    problem = IKProblem(target=Pose((0.3, 0.3, 0.0), (1.0, 0.0, 0.0, 0.0)), start={"elbow": 0.5}, **field)
    solutions = [planar_arm(tmp_path, solver=solver).solve(problem) for solver in ("trac_ik", "kdl")]
    assert solutions[0] == solutions[1]
    assert solutions[0].success == ("rotation_tolerance" in field), "nothing turns the arm over"


def test_pybullet_goes_to_a_position_in_any_orientation(tmp_path):
    arm = planar_arm(tmp_path, solver="pybullet")
    problem = IKProblem(target=Pose((0.3, 0.3, 0.0), (1.0, 0.0, 0.0, 0.0)), rotation_tolerance=(4.0, 4.0, 4.0))
    solution = arm.solve(problem)
    assert solution.success, solution.message


def test_pybullet_accepts_its_own_options_and_reports_wrong_lengths(tmp_path):
    rest = {"lowerLimits": [-1.0] * 3, "upperLimits": [1.0] * 3, "jointRanges": [2.0] * 3, "resetPoses": [0.1] * 3}
    arm = planar_arm(tmp_path, solver="pybullet", **rest)
    assert arm.upper == (1.0, 1.0, 1.0)
    target = arm.chain.pose([0.5, 0.9, -0.5])
    assert arm.solve(IKProblem(target=target)).success
    with pytest.raises(ConfigError, match="lowerLimits: expected 3 values, one for each of shoulder, elbow, .*; got 1"):
        planar_arm(tmp_path, solver="pybullet", **rest | {"lowerLimits": [-1.0]})


@pytest.mark.parametrize("solver", ["kdl", "global", "trac_ik", "pybullet"])
@pytest.mark.parametrize("position", [(1e9, 1e9, -1e9), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0 + 1e-7, 0.0, 0.0)])
def test_extreme_targets_and_starts_leave_nothing_outside_limits(tmp_path, solver, position):
    arm = planar_arm(tmp_path, solver=solver)
    for start in (1e9, -1e9, 3.0, 0.0):
        solution = arm.solve(IKProblem(target=Pose(position), start={"elbow": start, "shoulder": -start}))
        assert all(abs(q) <= 3.0 for q in solution.positions)
        assert math.isfinite(solution.position_error_m)
        assert solution.success == (abs(position[0] - 1.0) < 1e-3), "the arm is 1 m long and cannot fold up"
