"""Frames, Jacobians and the affine map of mimic joints; libraries are compared in test_backends.py."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from custom_ros_tools.errors import ConfigError, UnknownNameError
from robot_model.conformance import MIMIC, SKEW
from robot_model.frames import MAX_MATRIX_PRODUCTS
from robot_model.geometry import ZERO
from robot_model.joint_map import AffineMap, followed
from robot_model.model import RobotModel
from robot_model.urdf.elements import Mimic

KUKA = str(Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf")


def robot_of(folder: Path, text: str, joints: tuple[str, ...] = ()) -> RobotModel:
    (folder / "robot.urdf").write_text(text)
    return RobotModel(str(folder / "robot.urdf"), joints)


def test_many_configurations_have_the_frames_of_each(tmp_path):
    for robot in (RobotModel(KUKA), robot_of(tmp_path, MIMIC)):
        q = np.random.default_rng(0).uniform(-1.0, 1.0, (3 * MAX_MATRIX_PRODUCTS, len(robot.joint_names)))
        each = [robot.frames.of_links(row[None])[0] for row in q]
        np.testing.assert_allclose(robot.frames.of_links(q), each, atol=1e-14)
        link = robot.frames.links[-1]
        points = [robot.frames.jacobian(row[None], link, (0.1, 0.2, 0.3))[0] for row in q]
        np.testing.assert_allclose(robot.frames.jacobian(q, link, (0.1, 0.2, 0.3)), points, atol=1e-14)


def test_frames_of_no_configurations_are_none():
    robot = RobotModel(KUKA)
    assert robot.frames.of_links(np.empty((0, 7))).shape == (0, len(robot.links), 4, 4)


def test_link_pose_can_be_relative_to_any_other_link():
    robot, q = RobotModel(KUKA), np.full(7, 0.3)
    assert robot.pose(q, robot.root) == (ZERO, (0.0, 0.0, 0.0, 1.0))
    in_root = robot.pose(q, "lwr_arm_2_link") @ robot.pose(q, "lwr_arm_7_link", base="lwr_arm_2_link")
    assert np.concatenate(in_root) == pytest.approx(np.concatenate(robot.pose(q, "lwr_arm_7_link")))
    at = robot.frames.positions(q[None], "lwr_arm_7_link")[0]
    assert in_root.position == pytest.approx(at)


def test_undriven_joints_and_their_mimics_are_fixed(tmp_path):
    text = MIMIC.replace('lower="-1.5" upper="2"', 'lower="0.5" upper="2"')
    robot = robot_of(tmp_path, text, ("push",))
    assert robot.joint_names == ("push",)
    factors, offsets = robot.map_to(["hip", "push", "roll"])
    assert factors.tolist() == [[0.0], [1.0], [0.0]]
    assert offsets == pytest.approx([0.5, 0.0, -0.5 * 0.5 + 0.2])


def test_a_joint_follows_over_several_steps():
    mimics = {"b": Mimic("a", 2.0, 0.1), "c": Mimic("b", -3.0, 0.5)}
    assert followed("c", mimics) == ("a", -6.0, pytest.approx(0.2))
    to_all = AffineMap.of(["a", "b", "c", "d"], ["a"], mimics, {"d": 0.7})
    assert to_all(np.array([1.0])) == pytest.approx([1.0, 2.1, -5.8, 0.7])
    assert to_all(np.array([[1.0], [0.0]])) == pytest.approx(np.array([[1.0, 2.1, -5.8, 0.7], [0.0, 0.1, 0.2, 0.7]]))
    with pytest.raises(ValueError, match="joint 'a' follows 'b', which follows itself in the end"):
        followed("a", {"a": Mimic("b", 1.0, 0.0), "b": Mimic("a", 1.0, 0.0)})


def test_invalid_names_and_values_are_reported(tmp_path):
    with pytest.raises(UnknownNameError, match="roll"):
        robot_of(tmp_path, MIMIC, ("roll",))  # it mimics another one
    robot = robot_of(tmp_path, SKEW)
    with pytest.raises(UnknownNameError, match="thight.*did you mean 'thigh'"):
        robot.pose((0.0, 0.0, 0.0), "thight")
    with pytest.raises(ValueError, match="positions: expected 3 numbers"):
        robot.pose((0.0, 0.0), "tip")
    with pytest.raises(ConfigError, match="joint 'hip': axis: must not be zero"):
        robot_of(tmp_path, SKEW.replace("1 2 -2", "0 0 0"))
    with pytest.raises(ConfigError, match="mimics 'hop', which does not exist"):
        robot_of(tmp_path, MIMIC.replace('mimic joint="hip"', 'mimic joint="hop"'))
