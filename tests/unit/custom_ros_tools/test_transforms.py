"""Rotations and poses mean the same in every form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from custom_ros_tools.transforms import finite_vector, matrix_of, pose_of, quat_of, rpy_of, unit_quat

HALF = math.sqrt(0.5)


@pytest.mark.parametrize(
    ("rpy", "quat_xyzw"),
    [
        ((0, 0, 0), (0, 0, 0, 1)),
        ((math.pi / 2, 0, 0), (HALF, 0, 0, HALF)),
        ((0, math.pi / 2, 0), (0, HALF, 0, HALF)),
        ((0, 0, math.pi / 2), (0, 0, HALF, HALF)),
        ((math.pi / 2, 0, math.pi / 2), (0.5, 0.5, 0.5, 0.5)),  # first about x, then about the fixed z
    ],
)
def test_roll_pitch_yaw_turn_about_the_fixed_axes(rpy: tuple, quat_xyzw: tuple) -> None:
    """Defect 48: three numbers are an orientation too."""
    np.testing.assert_allclose(quat_of(rpy), quat_xyzw, atol=1e-12)
    np.testing.assert_allclose(quat_of(np.degrees(rpy), in_deg=True), quat_xyzw, atol=1e-12)


def test_roll_pitch_yaw_agree_with_tf_conversions() -> None:
    from tf_conversions import transformations

    for rpy in np.random.default_rng(0).uniform(-3, 3, (100, 3)):
        quat = quat_of(rpy)
        assert abs(quat @ transformations.quaternion_from_euler(*rpy)) == pytest.approx(1.0, abs=1e-12)
        np.testing.assert_allclose(rpy_of(quat), transformations.euler_from_quaternion(quat), atol=1e-9)


def test_quaternion_is_normalised_and_has_no_unit() -> None:
    np.testing.assert_allclose(quat_of([0, 0, 3, 4], in_deg=True), (0, 0, 0.6, 0.8))


def test_pose_comes_back_from_its_matrix() -> None:
    position, quat = np.array([1.0, 2.0, 3.0]), unit_quat([0.1, -0.2, 0.3, 0.9])
    T = matrix_of(position, quat)
    np.testing.assert_allclose(T @ [0, 0, 0, 1], [1, 2, 3, 1])
    again = pose_of(T)
    np.testing.assert_allclose(again[0], position)
    np.testing.assert_allclose(again[1], quat)


def test_quarter_turn_about_z_takes_x_to_y() -> None:
    np.testing.assert_allclose(matrix_of([0, 0, 0], [0, 0, HALF, HALF])[:3, :3] @ [1, 0, 0], [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("orientation", "told"),
    [
        ([0, 0, 0, 0], "quaternion: must not be zero"),
        ([0, 0, math.nan, 1], "quaternion: must be finite, got 0, 0, nan, 1"),
        ([0, math.inf, 0], "roll, pitch, yaw: must be finite, got 0, inf, 0"),
        ([0, 0], r"orientation: expected roll, pitch, yaw or a quaternion x, y, z, w, got shape \(2,\)"),
    ],
)
def test_invalid_orientation_is_refused(orientation: list, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        quat_of(orientation)


def test_vector_of_another_length_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"position: expected 3 numbers, got shape \(2,\)"):
        finite_vector([1, 2], 3, "position")


@pytest.mark.parametrize(
    ("matrix", "told"),
    [
        (np.eye(3), r"expected shape \(4, 4\), got \(3, 3\)"),
        (np.full((4, 4), math.nan), "must be finite"),
        (np.diag([1, 1, -1, 1]), "expected a rotation"),  # a mirror
        (np.diag([2, 2, 2, 1]), "expected a rotation"),
        (np.diag([1, 1, 1, 2]), "expected a rotation"),
    ],
)
def test_matrix_that_is_no_rigid_transform_is_refused(matrix: np.ndarray, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        pose_of(matrix)
