"""Poses and rotations agree with matrices; those of the simulator go on using PyBullet's arithmetic."""

from __future__ import annotations

import numpy as np
import pybullet
import pytest
from scipy.spatial.transform import Rotation

from custom_ros_tools.transforms import matrix_of
from robot_model import geometry
from robot_model.geometry import Pose, Twist, normalized, rotated, rotated_back, rotation_between
from rpbi.geometry import Pose as SimulatedPose

GENERATOR = np.random.default_rng(0)


def random_pose() -> Pose:
    return Pose(tuple(GENERATOR.normal(size=3).tolist()), normalized(GENERATOR.normal(size=4).tolist()))


def test_chained_and_inverse_poses_are_those_of_matrices():
    for _ in range(20):
        a, b = random_pose(), random_pose()
        np.testing.assert_allclose(matrix_of(*(a @ b)), matrix_of(*a) @ matrix_of(*b), atol=1e-14)
        np.testing.assert_allclose(matrix_of(*a.inverse()), np.linalg.inv(matrix_of(*a)), atol=1e-14)


def test_vectors_and_twists_turn_with_frames_and_back():
    quat, vector = random_pose().quat_xyzw, (0.3, -0.2, 0.5)
    turned = rotated(quat, vector)
    assert turned == pytest.approx(Rotation.from_quat(quat).apply(vector))
    assert rotated_back(quat, turned) == pytest.approx(vector)
    assert Twist(turned, turned).seen_from(quat) == (pytest.approx(vector), pytest.approx(vector))


def test_the_rotation_between_orientations_is_the_shorter_one():
    start, turn = random_pose().quat_xyzw, (0.4, -1.0, 0.3)
    end = (Rotation.from_rotvec(turn) * Rotation.from_quat(start)).as_quat().tolist()
    assert rotation_between(start, tuple(end)) == pytest.approx(turn)
    assert rotation_between(start, tuple(-part for part in end)) == pytest.approx(turn)


def test_long_vectors_are_shortened():
    assert geometry.shortened_to((3.0, 0.0, 4.0), 10.0) == (3.0, 0.0, 4.0)
    assert geometry.shortened_to((3.0, 0.0, 4.0), 1.0) == pytest.approx((0.6, 0.0, 0.8))


def test_poses_that_enter_the_simulator_are_chained_by_pybullet():
    other, simulated = random_pose(), SimulatedPose(*random_pose())
    for first, second in ((other, simulated), (simulated, other), (simulated, simulated)):
        assert first @ second == SimulatedPose(*pybullet.multiplyTransforms(*first, *second))
        assert isinstance(first @ second, SimulatedPose)
