"""Cameras: matrices, pixels and depths."""

from __future__ import annotations

import math

import numpy as np
import pybullet
import pytest
from rendering import back_project, project, rotation_matrix

from rpbi.geometry import Pose
from rpbi.render.camera import Intrinsics, camera_matrix, depth_in_metres, view_matrix

INTRINSICS = Intrinsics(width_px=640, height_px=480, fov_deg=40.0, near_m=0.1, far_m=10.0)
QUAT_XYZW = pybullet.getQuaternionFromEuler([0.3, -1.1, 2.0])


def pybullet_matrix(values):
    return np.array(values).reshape(4, 4).T


def test_focal_lengths_are_equal_and_follow_from_vertical_fov():
    K = INTRINSICS.K
    assert K[1, 1] == pytest.approx(240.0 / math.tan(math.radians(20.0)))
    assert K[0, 0] == pytest.approx(K[1, 1])
    assert K[0, 0] == pytest.approx(659.4, abs=0.05)


def test_principal_point_is_the_image_centre_counted_from_pixel_centres():
    assert INTRINSICS.K[:2, 2] == pytest.approx([319.5, 239.5])


def test_projection_equals_that_of_pybullet():
    expected = pybullet.computeProjectionMatrixFOV(40.0, 640 / 480, 0.1, 10.0)
    assert INTRINSICS.projection == pytest.approx(pybullet_matrix(expected), rel=1e-5)


def test_camera_matrix_agrees_with_projection_and_viewport_even_off_centre():
    projection = INTRINSICS.projection
    projection[0, 2], projection[1, 2] = 0.2, -0.3
    x, y, z = 0.3, -0.2, 1.7
    clip = projection @ [x, -y, -z, 1.0]
    ndc = clip[:3] / clip[3]
    u = (ndc[0] + 1.0) / 2.0 * 640 - 0.5
    v = (1.0 - ndc[1]) / 2.0 * 480 - 0.5
    pixel = camera_matrix(projection, 640, 480) @ [x, y, z]
    assert pixel[:2] / pixel[2] == pytest.approx([u, v])


def test_corner_of_the_view_is_the_first_pixels_outer_corner():
    half_height = math.tan(math.radians(20.0))
    corner = INTRINSICS.K @ [-half_height * 640 / 480, -half_height, 1.0]
    assert corner[:2] == pytest.approx([-0.5, -0.5])


def test_view_matrix_looks_along_z_with_y_down():
    eye = np.array([0.4, -1.0, 0.7])
    R = rotation_matrix(QUAT_XYZW)
    expected = pybullet.computeViewMatrix(eye, eye + R[:, 2], -R[:, 1])
    assert view_matrix(Pose(tuple(eye), QUAT_XYZW)) == pytest.approx(pybullet_matrix(expected), abs=1e-6)


@pytest.mark.parametrize("near, far", [(0.01, 100.0), (0.1, 10.0), (0.01, 10000.0)])
def test_depth_in_metres_undoes_the_projection(near, far):
    intrinsics = Intrinsics(near_m=near, far_m=far)
    z = np.linspace(near, min(far, 5.0), 50)
    P = intrinsics.projection
    buffer = ((P[2, 2] * -z + P[2, 3]) / z * 0.5 + 0.5).astype(np.float32)
    rounding_m = z**2 / near * 2.0**-24
    assert np.all(np.abs(depth_in_metres(buffer, intrinsics) - z) <= 2 * rounding_m + 1e-6)


def test_empty_pixels_have_far_plane_depth_in_single_precision():
    depth = depth_in_metres(np.ones((2, 3), np.float32), INTRINSICS)
    assert depth.dtype == np.float32
    assert depth == pytest.approx(np.full((2, 3), 10.0))


def test_depth_buffer_is_left_as_it_was():
    buffer = np.full((2, 2), 0.5, np.float32)
    depth_in_metres(buffer, INTRINSICS)
    assert np.all(buffer == 0.5)


def test_back_projected_pixels_project_onto_themselves():
    K = Intrinsics(width_px=8, height_px=6).K
    depth = np.linspace(0.5, 3.0, 48).reshape(6, 8)
    points = back_project(depth, K)
    pixels = project(points.reshape(-1, 3), Pose(), K)
    v, u = np.mgrid[:6, :8]
    assert pixels == pytest.approx(np.stack([u.ravel(), v.ravel(), depth.ravel()], axis=1))


def test_points_are_projected_from_the_pose_of_the_camera():
    camera = Pose((1.0, 2.0, 3.0), QUAT_XYZW)
    ahead = np.array(camera.position) + 2.0 * rotation_matrix(QUAT_XYZW)[:, 2]
    assert project([ahead], camera, INTRINSICS.K)[0] == pytest.approx([319.5, 239.5, 2.0])
