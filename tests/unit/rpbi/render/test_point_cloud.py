"""Point clouds: where the points are, which colour they have, and where there are none."""

from __future__ import annotations

import numpy as np
import pytest
from rendering import back_project

from rpbi.render.camera import Intrinsics, PointCloud

INTRINSICS = Intrinsics(width_px=32, height_px=24, fov_deg=60.0, near_m=0.1, far_m=5.0)
SHAPE = INTRINSICS.height_px, INTRINSICS.width_px


@pytest.fixture
def images():
    generator = np.random.default_rng(1)
    depth_m = generator.uniform(0.2, 4.0, SHAPE).astype(np.float32)
    colour = generator.integers(0, 256, (*SHAPE, 3), np.uint8)
    return depth_m, colour


def test_points_are_those_that_K_back_projects(images):
    points = PointCloud(INTRINSICS).of(*images)
    assert points.shape == (*SHAPE, 4) and points.dtype == np.float32
    assert points[..., :3] == pytest.approx(back_project(images[0], INTRINSICS.K), abs=1e-6)


def test_colour_is_packed_as_pcl_reads_it(images):
    points = PointCloud(INTRINSICS).of(*images)
    packed = np.ascontiguousarray(points[..., 3]).view(np.uint32)
    red, green, blue = (images[1][..., channel].astype(np.uint32) for channel in range(3))
    assert np.array_equal(packed, red << 16 | green << 8 | blue)


def test_empty_pixels_have_no_point_and_keep_their_colour(images):
    depth_m, colour = images
    depth_m[3, 4] = np.float32(INTRINSICS.far_m) * np.float32(1.0 - 1e-7)  # as the depth buffer rounds it
    depth_m[3, 5] = 4.99
    points = PointCloud(INTRINSICS).of(depth_m, colour)
    assert np.isnan(points[3, 4, :3]).all()
    assert np.isfinite(points[3, 5]).all()
    assert np.isnan(points[..., 2]).sum() == 1


def test_a_later_frame_leaves_nothing_of_an_earlier_one(images):
    cloud = PointCloud(INTRINSICS)
    depth_m, colour = images
    cloud.of(np.full_like(depth_m, INTRINSICS.far_m), colour)
    assert np.array_equal(cloud.of(depth_m, colour), PointCloud(INTRINSICS).of(depth_m, colour))
