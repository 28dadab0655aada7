"""Tasks of formulations: what they want, and that their Jacobians are the derivatives of their values."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from tree_robot import TREE

from ik_ros.problem import IKProblem
from ik_ros.shape import ShapeConfig
from ik_ros.tasks import TASKS
from ik_ros.tasks.com_in_support import ComInSupport
from ik_ros.tasks.robot import PinocchioRobot
from ik_ros.tasks.task import Task

SHAPES = [
    {"name": "hand", "link": "left_hand", "sphere": 0.05},
    {"name": "arm", "link": "left_arm", "capsule": [0.04, 0.2], "position": [0.0, 0.0, 0.15]},
    {"name": "right_arm", "link": "right_arm", "capsule": [0.04, 0.2], "position": [0.0, 0.0, 0.15]},
    {"name": "table", "box": [0.6, 0.6, 0.1], "position": [0.4, 0.0, 0.1], "orientation": [0.1, 0.2, 0.0, 1.0]},
    {"name": "pole", "capsule": [0.05, 1.0], "position": [0.5, 0.3, 0.5]},
    {"name": "ball", "sphere": 0.1, "position": [0.6, 0.2, 0.4]},
]
SQUARE = [[0.1, 0.1, 0.0], [0.1, -0.1, 0.0], [-0.1, -0.1, 0.0], [-0.1, 0.1, 0.0]]
EXAMPLES: dict[str, dict[str, Any]] = {
    "frame_pose": {"frame": "left_hand", "goal": [0.3, 0.2, 0.4, 0.1, 0.2, 0.3, 0.9]},
    "frame_position": {"frame": "left_hand", "goal": [0.3, 0.2, 0.4], "axes": ["x", "z"]},
    "frame_orientation": {"frame": "left_hand", "goal": [0.1, 0.2, 0.3, 0.9], "axes": ["rx", "ry"]},
    "look_at": {"frame": "right_hand", "axis": [1.0, 0.5, 0.0], "goal": [1.0, 2.0, 0.5]},
    "posture": {"goal": {"left_1": 0.3, "right_2": -0.2}},
    "closeness": {},
    "com": {"goal": [0.0, 0.1, 0.2], "axes": ["x", "z"]},
    "com_in_support": {"support": {"body": SQUARE}},
    "joint_limits": {"limits": {"left_1": [-0.1, 0.2]}},
    "velocity_limits": {"dt_s": 0.01, "limits": {"left_1": 1.0}},
    "acceleration_limits": {"dt_s": 0.01, "limits": {"left_1": 1.0}},
    "distance": {
        "pairs": [["hand", "ball"], ["hand", "table"], ["arm", "pole"], ["table", "arm"], ["arm", "right_arm"]],
        "at_least": 10.0,
    },
}


def robot_with_shapes(tmp_path: Path, floating: bool = True, **options: Any) -> PinocchioRobot:
    path = tmp_path / "tree.urdf"
    path.write_text(TREE)
    robot = PinocchioRobot(str(path), floating, **options)
    for shape in SHAPES:
        robot.add_shape(ShapeConfig.parse(shape, "test"))
    return robot


def make_task(robot: PinocchioRobot, kind: str, **changes: Any) -> Task:
    found = TASKS.find(kind)
    data = {"name": "it", "type": kind, **EXAMPLES[kind], **changes}
    return found(found.Config.parse(data, "test"), robot)


def random_configuration(robot: PinocchioRobot, seed: int) -> np.ndarray:
    generator = np.random.default_rng(seed)
    q = robot.with_positions(pin.neutral(robot.model), generator.uniform(-1.2, 1.2, len(robot.joint_names)))
    if robot.is_floating:
        q[:3], q[3:7] = generator.normal(0.0, 0.2, 3), generator.normal(size=4)
        q[3:7] /= np.linalg.norm(q[3:7])
    return q


def test_every_task_has_an_example_here():
    assert set(EXAMPLES) == set(TASKS)


@pytest.mark.parametrize("floating", [False, True])
@pytest.mark.parametrize("kind", sorted(set(TASKS) - {"com_in_support"}))
def test_jacobian_is_the_derivative_of_the_values(tmp_path, kind, floating):
    robot = robot_with_shapes(tmp_path, floating, joints=["right_2", "left_1", "left_2", "slide"])
    task = make_task(robot, kind)
    checked = 0
    for seed in range(20):
        q = random_configuration(robot, seed)
        task.begin(IKProblem(), None, q)
        robot.update(q)
        rows = task.rows(q)
        for i in range(len(robot.free)):
            direction = np.zeros(robot.model.nv)
            direction[robot.free[i]] = 1e-6
            ahead, behind = (pin.integrate(robot.model, q, sign * direction) for sign in (1.0, -1.0))
            robot.update(ahead)
            after = task.rows(ahead).values
            robot.update(behind)
            slope = (after - task.rows(behind).values) / 2e-6
            smooth = rows.values > 0.0 if kind == "distance" else np.full(len(slope), True)  # inside boxes are edges
            assert slope[smooth] == pytest.approx(rows.jacobian[smooth, i], abs=2e-4), (seed, i)
            checked += int(smooth.sum())
    assert checked > 20


def test_jacobian_of_balance_follows_centre_of_mass_over_supporting_feet(tmp_path):
    robot = robot_with_shapes(tmp_path, floating=False)
    task = make_task(robot, "com_in_support")
    q = random_configuration(robot, 1)
    robot.update(q)
    rows = task.rows(q)
    for i in range(len(robot.free)):
        direction = np.zeros(robot.model.nv)
        direction[robot.free[i]] = 1e-6
        ahead = pin.integrate(robot.model, q, direction)
        robot.update(ahead)
        assert (task.rows(ahead).values - rows.values) / 1e-6 == pytest.approx(rows.jacobian[:, i], abs=1e-4)


def test_values_of_a_pose_task_are_errors_in_goal_axes(tmp_path):
    robot = robot_with_shapes(tmp_path, floating=False)
    q = random_configuration(robot, 3)
    robot.update(q)
    pose = robot.frame(robot.link_id("left_hand"))
    goal = pose * pin.SE3(pin.exp3(np.array((0.0, 0.3, 0.0))), np.array((0.0, 0.0, 0.1)))
    task = make_task(robot, "frame_pose", goal=pin.SE3ToXYZQUAT(goal).tolist())
    task.begin(IKProblem(), None, q)
    off = goal.actInv(pose)
    assert task.rows(q).values == pytest.approx([*off.translation, 0.0, -0.3, 0.0])
    residual = task.residual(task.rows(q).beyond())
    assert residual == pytest.approx((0.1, 0.3))
    assert task.size(residual) == pytest.approx(100.0)


def test_only_axes_that_are_chosen_count(tmp_path):
    robot = robot_with_shapes(tmp_path, floating=False)
    q = random_configuration(robot, 3)
    robot.update(q)
    x, y, z = robot.frame(robot.link_id("left_hand")).translation
    task = make_task(robot, "frame_position", goal=[float(x), float(y) + 0.5, float(z)], axes=["x", "z"])
    task.begin(IKProblem(), None, q)
    assert task.rows(q).values == pytest.approx([0.0, 0.0], abs=1e-12)


def test_looking_at_a_point_behind_is_half_a_turn_off(tmp_path):
    robot = robot_with_shapes(tmp_path, floating=False)
    q = random_configuration(robot, 0)
    robot.update(q)
    hand = robot.frame(robot.link_id("right_hand"))
    for way, angle in ((1.0, 0.0), (-1.0, math.pi)):
        point = hand.act(np.array((way, 0.0, 0.0))).tolist()
        task = make_task(robot, "look_at", axis=[1.0, 0.0, 0.0], goal=point)
        task.begin(IKProblem(), None, q)
        assert task.residual(task.rows(q).beyond()).orientation_rad == pytest.approx(angle, abs=1e-6)


def test_balance_is_kept_inside_the_hull_of_the_soles_only(tmp_path):
    robot = robot_with_shapes(tmp_path, floating=True)
    task = make_task(robot, "com_in_support", margin=0.02)
    assert isinstance(task, ComInSupport)
    q = robot.configuration({})
    robot.update(q)
    com = robot.com(q)[0]
    for aside, inside in ((0.0, True), (0.07, True), (0.09, False), (0.2, False)):
        corners = [[x + float(com[0]) - aside, y + float(com[1]), z] for x, y, z in SQUARE]
        task = make_task(robot, "com_in_support", margin=0.02, support={"body": [*corners, corners[0], [*corners[1]]]})
        assert (task.residual(task.rows(q).beyond()).position_m == 0.0) is inside
    assert task.polygon().shape == (4, 2)


def test_limits_on_speed_are_around_the_previous_solution(tmp_path):
    robot = robot_with_shapes(tmp_path, floating=False)
    task = make_task(robot, "velocity_limits")
    q = robot.configuration({"left_1": 0.5})
    task.begin(IKProblem(), None, q)
    assert task.rows(q).beyond() == pytest.approx([0.0]), "without a previous solution there is no limit"
    task.begin(IKProblem(previous=({"left_1": 0.2},)), None, q)
    assert task.rows(q).beyond() == pytest.approx([0.5 - 0.2 - 0.01])


def test_acceleration_limits_extrapolate_from_the_last_two_solutions(tmp_path):
    robot = robot_with_shapes(tmp_path, floating=False)
    task = make_task(robot, "acceleration_limits")
    q = robot.configuration({"left_1": 0.5})
    task.begin(IKProblem(previous=({"left_1": 0.2}, {"left_1": 0.3})), None, q)
    assert task.rows(q).beyond() == pytest.approx([0.5 - 0.4 - 1e-4])
    task.begin(IKProblem(previous=({"left_1": 0.3},)), None, q)
    assert task.rows(q).beyond() == pytest.approx([0.5 - 0.3 - 1e-4]), "with one solution it stood still"


def test_closeness_is_to_the_previous_solution_else_to_the_start(tmp_path):
    robot = robot_with_shapes(tmp_path, floating=False)
    task = make_task(robot, "closeness")
    q = robot.configuration({"left_1": 0.5})
    task.begin(IKProblem(), None, q)
    assert task.rows(q).beyond() == pytest.approx(np.zeros(len(robot.joint_names)))
    task.begin(IKProblem(previous=(dict.fromkeys(robot.joint_names, 0.1),)), None, q)
    assert task.rows(q).beyond() == pytest.approx(robot.positions(q) - 0.1)


def test_frames_away_from_the_root_can_be_the_base(tmp_path):
    root, hand = robot_with_shapes(tmp_path, False), robot_with_shapes(tmp_path, False, base="mount")
    q = random_configuration(root, 5)
    for robot in (root, hand):
        robot.update(q)
    in_root, mount = root.frame(root.link_id("left_hand")), root.frame(root.link_id("mount"))
    in_mount = hand.frame(hand.link_id("left_hand"))
    assert in_mount.homogeneous == pytest.approx((mount.inverse() * in_root).homogeneous)
    assert hand.com(q)[0] == pytest.approx(mount.actInv(root.com(q)[0]))


@pytest.mark.parametrize("floating", [False, True])
def test_centre_of_mass_includes_all_links(tmp_path, floating):
    robot = robot_with_shapes(tmp_path, floating)
    q = random_configuration(robot, 2)
    robot.update(q)
    centres = [robot.frame(robot.link_id(link)).act(np.array((0.02, 0.01, 0.1))) for link in robot.links]
    assert len(centres) == 7
    assert robot.com(q)[0] == pytest.approx(np.mean(centres, axis=0))
