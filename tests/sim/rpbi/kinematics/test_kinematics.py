"""Forward and inverse kinematics of real robots."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
from worlds import iiwa, write_world

from custom_ros_tools.errors import ConfigError, PhysicsError, UnknownNameError
from rpbi.geometry import Pose
from rpbi.kinematics import IKProblem, Kinematics
from rpbi.world import World

DATA = Path(pybullet_data.getDataPath())
EXAMPLES = Path(__file__).resolve().parents[4] / "src/rpbi_examples/robots"
ELBOW = [0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0]
ROBOTS = {
    "iiwa": (DATA / "kuka_iiwa/model.urdf", "lbr_iiwa_link_7", ELBOW),
    "panda": (DATA / "franka_panda/panda.urdf", "panda_hand", [*ELBOW[:5], 0.8, 0.0, 0.02, 0.02]),
    "xarm6": (DATA / "xarm/xarm6_robot.urdf", "link6", [0.0, -0.5, -0.5, 0.0, 0.8, 0.0]),
    "kuka_lwr": (EXAMPLES / "kuka_lwr.urdf", "lwr_arm_7_link", ELBOW),
}
"""File, link and a posture with a bent elbow."""
SLIDER = """<robot name="slider">
  <link name="rail"/>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="carriage"/><axis xyz="1 0 0"/>
    <origin xyz="0 0 0.2"/><limit lower="-0.5" upper="0.5" effort="10" velocity="1"/></joint>
  <link name="carriage"/>
  <joint name="spin" type="continuous"><parent link="carriage"/><child link="disc"/><axis xyz="0 0 1"/></joint>
  <link name="disc"/>
  <joint name="mount" type="fixed"><parent link="disc"/><child link="pen"/><origin xyz="0.3 0 0"/></joint>
  <link name="pen"/>
  <joint name="ball" type="spherical"><parent link="pen"/><child link="bob"/></joint>
  <link name="bob"/>
  <joint name="lid" type="revolute"><parent link="rail"/><child link="cover"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="1" effort="10" velocity="1"/></joint>
  <link name="cover"/>
  <joint name="plate" type="fixed"><parent link="rail"/><child link="label"/><origin xyz="0 0.1 0"/></joint>
  <link name="label"/>
</robot>"""


@pytest.fixture(scope="module", params=ROBOTS)
def arm(request):
    path, link, elbow = ROBOTS[request.param]
    kinematics = Kinematics(str(path))
    yield kinematics, link, elbow
    kinematics.close()


@pytest.fixture(scope="module")
def iiwa_arm():
    kinematics = Kinematics(str(ROBOTS["iiwa"][0]))
    yield kinematics
    kinematics.close()


@pytest.fixture
def slider(tmp_path):
    path = tmp_path / "slider.urdf"
    path.write_text(SLIDER)
    kinematics = Kinematics(str(path))
    yield kinematics
    kinematics.close()


def _random_positions(kinematics, count):
    limits = kinematics.limits
    generator = np.random.default_rng(1)
    return [generator.uniform(limits.lower, limits.upper) for _ in range(count)]


def _far(pose: Pose, other: Pose) -> tuple[float, float]:
    """Returns distance [m] and angle [rad] between two poses."""
    same_side = math.copysign(1.0, np.dot(pose.quat_xyzw, other.quat_xyzw))
    chord = math.dist(pose.quat_xyzw, np.multiply(same_side, other.quat_xyzw))
    return math.dist(pose.position, other.position), 4.0 * math.asin(chord / 2.0)


def _assert_solved(kinematics, link, goal, solution):
    distance, angle = _far(kinematics.forward(solution.positions, link), goal)
    assert solution.success, solution.message
    assert distance <= 1e-3 and angle <= 0.01, "success is told only where it is true"
    _assert_within_limits(kinematics, solution)


def _assert_within_limits(kinematics, solution):
    limits = kinematics.limits
    assert all(low <= q <= high for low, q, high in zip(limits.lower, solution.positions, limits.upper))


def test_forward_kinematics_are_those_of_the_simulated_robot(tmp_path):
    """The private copy has neither shapes nor masses: link frames must not be mixed up with those of mass centres."""
    config = iiwa(
        loadURDF={
            "fileName": "kuka_iiwa/model.urdf",
            "basePosition": [0.3, -0.2, 0.1],
            "baseOrientation": [0.0, 0.0, math.sin(0.4), math.cos(0.4)],
            "globalScaling": 1.5,
        },
        initial_joint_position=dict(zip([f"lbr_iiwa_joint_{i}" for i in range(1, 8)], ELBOW)),
        initial_revolute_joint_positions_are_deg=False,
    )
    world = World.from_file(write_world(tmp_path, robots=(config,)))
    robot = world.bodies["iiwa"]
    assert robot.kinematics.joint_names == tuple(joint.name for joint in robot.model.driven)
    for joint in robot.joints:
        state = robot.pb.getLinkState(robot.body_id, joint.index, computeForwardKinematics=True)
        pose = robot.base_pose() @ robot.kinematics.forward(list(robot.joint_positions().values()), joint.link)
        assert _far(pose, Pose(state[4], state[5])) == pytest.approx((0.0, 0.0), abs=1e-4)
    world.close()


@pytest.mark.parametrize("start", ["far", "near"])
def test_reachable_poses_are_reached_within_limits(arm, start):
    kinematics, link, elbow = arm
    generator = np.random.default_rng(2)
    for positions in _random_positions(kinematics, 50):
        goal = kinematics.forward(positions, link)
        near = positions + generator.normal(0.0, 0.1, len(elbow))
        near = np.clip(near, kinematics.limits.lower, kinematics.limits.upper)
        problem = IKProblem(link, *goal, currentPosition=list(near) if start == "near" else elbow)
        _assert_solved(kinematics, link, goal, kinematics.solve(problem))


def test_joint_near_a_limit_never_jumps_to_the_other(iiwa_arm):
    """On the way to a near solution, joints overshoot their limits; there they stop."""
    generator = np.random.default_rng(7)
    for positions in _random_positions(iiwa_arm, 400):
        near = np.clip(positions + generator.normal(0.0, 0.1, 7), iiwa_arm.limits.lower, iiwa_arm.limits.upper)
        goal = iiwa_arm.forward(positions, "lbr_iiwa_link_7")
        solution = iiwa_arm.solve(IKProblem("lbr_iiwa_link_7", *goal, currentPosition=near))
        assert solution.success and np.abs(np.subtract(solution.positions, near)).max() < 1.0


def test_selectively_damped_least_squares_reach_too_and_pybullet_survives_it(arm):
    kinematics, link, elbow = arm
    for positions in _random_positions(kinematics, 10):
        goal = kinematics.forward(positions, link)
        problem = IKProblem(link, goal.position, goal.quat_xyzw, currentPosition=elbow, solver=1)
        _assert_solved(kinematics, link, goal, kinematics.solve(problem))


def test_without_orientation_only_the_position_counts(iiwa_arm):
    for positions in _random_positions(iiwa_arm, 20):
        goal = iiwa_arm.forward(positions, "lbr_iiwa_link_7")
        solution = iiwa_arm.solve(IKProblem("lbr_iiwa_link_7", goal.position, currentPosition=ELBOW))
        assert solution.success, solution.message
        assert math.dist(iiwa_arm.forward(solution.positions, "lbr_iiwa_link_7").position, goal.position) <= 1e-3
        assert solution.orientation_error_rad == 0.0


def test_short_displacement_needs_no_large_motion(iiwa_arm):
    here = iiwa_arm.forward(ELBOW, "lbr_iiwa_link_7")
    x, y, z = here.position
    solution = iiwa_arm.solve(IKProblem("lbr_iiwa_link_7", (x, y + 0.01, z), here.quat_xyzw, currentPosition=ELBOW))
    assert solution.success
    assert np.abs(np.subtract(solution.positions, ELBOW)).max() < 0.1


def test_the_answer_is_in_the_branch_of_its_start(arm):
    (kinematics, link, _), random = arm, np.random.default_rng(3)
    lower, upper = np.maximum(kinematics.limits.lower, -np.pi), np.minimum(kinematics.limits.upper, np.pi)
    further = []
    for _ in range(50):
        start = random.uniform(lower, upper)
        goal = np.clip(start + random.uniform(-0.8, 0.8, len(start)), lower, upper)
        pose = kinematics.forward(goal.tolist(), link)
        found = kinematics.solve(IKProblem(link, pose.position, pose.quat_xyzw, currentPosition=start.tolist()))
        assert found.success
        further.append(np.abs(found.positions - start).max() > max(np.abs(goal - start).max(), 1.0))
    assert sum(further) <= 1


def test_a_robot_that_is_there_stays(iiwa_arm):
    here = iiwa_arm.forward(ELBOW, "lbr_iiwa_link_7")
    solution = iiwa_arm.solve(IKProblem("lbr_iiwa_link_7", *here, currentPosition=ELBOW))
    assert solution.success and solution.positions == tuple(ELBOW)


@pytest.mark.parametrize("position", [(1.0, 0.0, 1.0), (0.0, -3.0, 0.2), (1e9, 0.0, 0.0)])
def test_unreachable_target_fails_with_residual_and_best_pose_within_limits(iiwa_arm, position):
    solution = iiwa_arm.solve(IKProblem("lbr_iiwa_link_7", position, (0.0, 0.0, 0.0, 1.0), currentPosition=ELBOW))
    assert not solution.success
    _assert_within_limits(iiwa_arm, solution)
    left = math.dist(iiwa_arm.forward(solution.positions, "lbr_iiwa_link_7").position, position)
    assert left == pytest.approx(solution.position_error_m)
    assert f"misses its target by {left * 1e3:.4g} mm and {solution.orientation_error_rad:.3g} rad" in solution.message


def test_best_pose_for_an_unreachable_target_is_the_stretched_arm(iiwa_arm):
    reach = 0.42 + 0.40 + 0.081  # shoulder to link 7, which starts 0.36 m above the base
    solution = iiwa_arm.solve(IKProblem("lbr_iiwa_link_7", (reach + 0.5, 0.0, 0.36), currentPosition=ELBOW))
    assert solution.position_error_m == pytest.approx(0.5, abs=0.01)
    assert "0.01 rad" not in solution.message, "no orientation was asked for"


def test_target_that_moves_out_of_reach_causes_no_large_motion(iiwa_arm):
    link, q = "lbr_iiwa_link_7", np.array(ELBOW)
    (x, y, z), quat = iiwa_arm.forward(ELBOW, link)
    missed_m = []
    for way_m in np.arange(0.025, 1.0, 0.025):
        solution = iiwa_arm.solve(IKProblem(link, (x + way_m, y, z), quat, currentPosition=q))
        assert np.abs(solution.positions - q).max() < 0.3
        q = np.array(solution.positions)
        missed_m.append(solution.position_error_m)
    assert missed_m[0] < 1e-3 and np.all(np.diff(missed_m) > -1e-3), "it ends out of reach, further and further"
    assert missed_m[-1] < 0.8


def test_no_nearby_posture_is_closer_to_an_unreachable_target(iiwa_arm):
    link, generator = "lbr_iiwa_link_7", np.random.default_rng(3)

    def off(q: np.ndarray) -> float:
        here = iiwa_arm.forward(q, link)
        angle = 2.0 * math.acos(min(1.0, abs(np.dot(here.quat_xyzw, goal.quat_xyzw))))
        return math.hypot(math.dist(here.position, target) / 1e-3, angle / 0.01)

    for goal in [iiwa_arm.forward(positions, link) for positions in _random_positions(iiwa_arm, 5)]:
        target = tuple(1.6 / math.hypot(*goal.position) * np.array(goal.position))
        solution = iiwa_arm.solve(IKProblem(link, target, goal.quat_xyzw, currentPosition=ELBOW))
        least = off(np.array(solution.positions))
        assert not solution.success and least > 100.0
        for turn in generator.normal(0.0, 0.02, (100, 7)):
            other = np.clip(solution.positions + turn, iiwa_arm.limits.lower, iiwa_arm.limits.upper)
            assert off(other) > 0.999 * least


def test_solution_is_independent_of_previous_problems(iiwa_arm):
    goal = iiwa_arm.forward(_random_positions(iiwa_arm, 3)[2], "lbr_iiwa_link_7")
    problem = IKProblem("lbr_iiwa_link_7", *goal, currentPosition=ELBOW)
    first = iiwa_arm.solve(problem)
    iiwa_arm.solve(IKProblem("lbr_iiwa_link_4", (0.2, 0.1, 0.5), solver=1))
    iiwa_arm.solve(IKProblem("lbr_iiwa_link_7", (3.0, 0.0, 0.0)))
    assert iiwa_arm.solve(problem) == first
    fresh = Kinematics(str(ROBOTS["iiwa"][0]))
    assert fresh.solve(problem) == first
    fresh.close()


def test_rest_posture_is_kept_as_closely_as_the_target_allows(iiwa_arm):
    """An iiwa has one joint to spare: among its solutions, the elbow goes where the posture has it."""
    link, n = "lbr_iiwa_link_7", 7
    for goal in [iiwa_arm.forward(positions, link) for positions in _random_positions(iiwa_arm, 10)]:
        plain = iiwa_arm.solve(IKProblem(link, *goal, currentPosition=ELBOW))
        problem = IKProblem(
            link,
            *goal,
            lowerLimits=[-3.2] * n,
            upperLimits=[3.2] * n,
            jointRanges=[1.0] * n,
            resetPoses=ELBOW,
            currentPosition=ELBOW,
        )
        solution = iiwa_arm.solve(problem)
        _assert_solved(iiwa_arm, link, goal, solution)
        distance = np.linalg.norm(np.subtract(solution.positions, ELBOW))
        assert distance <= np.linalg.norm(np.subtract(plain.positions, ELBOW)) + 1e-6
        for elbow_swing in (-0.05, 0.05):  # other solutions nearby are no nearer
            lower, upper = np.array([-3.2] * n), np.array([3.2] * n)
            lower[2] = upper[2] = solution.positions[2] + elbow_swing
            if abs(lower[2]) > iiwa_arm.limits.upper[2]:
                continue
            other = iiwa_arm.solve(
                dataclasses.replace(
                    problem, lowerLimits=list(lower), upperLimits=list(upper), resetPoses=solution.positions
                )
            )
            if other.success:
                assert np.linalg.norm(np.subtract(other.positions, ELBOW)) > distance - 1e-3


def test_limits_narrower_than_those_of_the_urdf_hold(iiwa_arm):
    link, n = "lbr_iiwa_link_7", 7
    lower, upper = [-3.2] * n, [3.2] * n
    lower[2] = upper[2] = 0.3
    lower[6], upper[6] = -0.2, 0.1
    positions = [0.5, 0.4, 0.3, -1.0, 0.6, 0.7, 0.05]
    goal = iiwa_arm.forward(positions, link)
    limits = {"lowerLimits": lower, "upperLimits": upper, "jointRanges": [1.0] * n, "resetPoses": [0.0] * n}
    solution = iiwa_arm.solve(IKProblem(link, *goal, **limits))
    assert solution.success, solution.message
    assert solution.positions[2] == 0.3
    assert -0.2 <= solution.positions[6] <= 0.1


def test_a_damped_joint_moves_less(iiwa_arm):
    link = "lbr_iiwa_link_7"
    x, y, z = iiwa_arm.forward(ELBOW, link).position
    problem = IKProblem(link, (x, y + 0.2, z), currentPosition=ELBOW)
    moved = abs(iiwa_arm.solve(problem).positions[0])
    damped = iiwa_arm.solve(dataclasses.replace(problem, jointDamping=[100.0, *[0.1] * 6]))
    assert damped.success and abs(damped.positions[0]) < 0.2 * moved


def test_a_smaller_threshold_leaves_a_smaller_residual(iiwa_arm):
    link = "lbr_iiwa_link_7"
    goals = [iiwa_arm.forward(positions, link) for positions in _random_positions(iiwa_arm, 10)]
    fine = [iiwa_arm.solve(IKProblem(link, *goal, residualThreshold=1e-5)).position_error_m for goal in goals]
    coarse = [iiwa_arm.solve(IKProblem(link, *goal, residualThreshold=0.5)).position_error_m for goal in goals]
    assert max(fine) <= 1e-5 < max(coarse) <= 1e-3


def test_unattainable_threshold_does_not_lead_away_from_the_near_solution(iiwa_arm):
    link = "lbr_iiwa_link_7"
    for positions in _random_positions(iiwa_arm, 10):
        near = iiwa_arm.limits.wrap_to_limits(positions + 0.05, positions)[0]
        goal = iiwa_arm.forward(positions, link)
        solution = iiwa_arm.solve(IKProblem(link, *goal, currentPosition=near, residualThreshold=1e-15))
        assert solution.success
        assert np.abs(np.subtract(solution.positions, near)).max() < 0.5


def test_few_iterations_get_less_far_but_never_outside_limits(iiwa_arm):
    problem = IKProblem("lbr_iiwa_link_7", (-0.5, 0.3, 0.4), (0.0, 1.0, 0.0, 0.0), currentPosition=ELBOW)
    full, short = iiwa_arm.solve(problem), iiwa_arm.solve(dataclasses.replace(problem, maxNumIterations=1))
    assert full.success and not short.success
    assert (np.abs(short.positions) <= iiwa_arm.limits.upper).all()


def test_joints_without_limits_turn_and_prismatic_ones_slide(slider):
    assert slider.joint_names == ("slide", "spin", "lid")
    solution = slider.solve(IKProblem("pen", (0.2, 0.3, 0.2), currentPosition=[0.0, 20.0, 0.7]))
    assert solution.success, solution.message
    slide, spin, _ = solution.positions
    assert slide + 0.3 * math.cos(spin) == pytest.approx(0.2, abs=1e-3)
    assert 0.3 * math.sin(spin) == pytest.approx(0.3, abs=1e-3)
    assert abs(spin - 20.0) < math.pi + 1e-6, "of all turns, the nearest"


def test_joints_that_do_not_move_the_link_stay(slider):
    solution = slider.solve(IKProblem("pen", (0.2, 0.3, 0.2), currentPosition=[0.0, 0.1, 0.7]))
    assert solution.positions[2] == 0.7
    assert solution.chain == ("slide", "spin")
    assert solution.chain_positions == solution.positions[:2]


def test_a_link_that_no_joint_moves_is_where_it_is(slider):
    assert slider.solve(IKProblem("label", (0.0, 0.1, 0.0), (0.0, 0.0, 0.0, 1.0))).success
    solution = slider.solve(IKProblem("label", (0.0, 0.2, 0.0), currentPosition=[0.1, 0.2, 0.3]))
    assert not solution.success
    assert (solution.positions, solution.chain) == ((0.1, 0.2, 0.3), ())


def test_link_on_a_ball_joint_is_refused_and_named(slider):
    with pytest.raises(ValueError, match="link_name: 'bob' hangs on 'ball', a spherical joint; only revolute"):
        slider.solve(IKProblem("bob", (0.2, 0.3, 0.2)))


def test_root_link_is_refused_with_a_reason(slider):
    with pytest.raises(ValueError, match="link_name: 'rail' is the root link, which no joint moves"):
        slider.solve(IKProblem("rail", (0.2, 0.3, 0.2)))


@pytest.mark.parametrize("link", ["pne", ""])
def test_unknown_link_is_reported_with_known_ones(slider, link):
    with pytest.raises(UnknownNameError, match=f"unknown link '{link}': known are carriage, disc, pen, bob, cover"):
        slider.solve(IKProblem(link, (0.2, 0.3, 0.2)))


def test_lists_of_the_wrong_length_are_refused_by_name(slider):
    with pytest.raises(ValueError, match="currentPosition: expected 3 values, one for each of slide, spin, lid; got 2"):
        slider.solve(IKProblem("pen", (0.2, 0.3, 0.2), currentPosition=[0.0, 0.0]))
    with pytest.raises(ValueError, match="positions: expected 3 finite values"):
        slider.forward([0.0, math.nan, 0.0], "pen")


def test_urdfs_with_surrounding_text_load_and_broken_ones_are_named(tmp_path):
    """PyBullet's own humanoid ends with a zero byte, and others have a comment before the XML declaration."""
    path = tmp_path / "around.urdf"
    path.write_text(f"\n<!-- a comment -->\n<?xml version='1.0'?>\n{SLIDER}\n\0")
    around = Kinematics(str(path))
    assert around.joint_names == ("slide", "spin", "lid")
    around.close()
    path.write_text(SLIDER.replace("</joint>", "", 1))
    with pytest.raises(ConfigError, match="around.urdf: expected well-formed XML"):
        Kinematics(str(path))
    with pytest.raises(ConfigError, match="nowhere.urdf: no such file"):
        Kinematics(str(tmp_path / "nowhere.urdf"))


def test_kinematics_end_with_their_robot(tmp_path):
    world = World.from_file(write_world(tmp_path, robots=(iiwa(),)))
    kinematics = world.bodies["iiwa"].kinematics
    world.remove("iiwa")
    with pytest.raises(PhysicsError, match="the robot was removed"):
        kinematics.solve(IKProblem("lbr_iiwa_link_7", (0.4, 0.1, 0.6)))
    world.close()
