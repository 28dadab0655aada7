"""The motions of the camera examples."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rpbi.camera import rotation_matrix
from rpbi_examples import figure_eight, orbit


@pytest.mark.parametrize("time_s", [0.0, 3.0, 11.0])
def test_orbiting_camera_looks_at_its_target_and_keeps_the_horizon_level(time_s):
    position, quat_xyzw = orbit.camera_pose(time_s)
    right, down, forward = rotation_matrix(quat_xyzw).T
    towards = np.array([0.0, 0.0, orbit.TARGET_HEIGHT]) - position
    assert forward == pytest.approx(towards / np.linalg.norm(towards))
    assert right[2] == pytest.approx(0.0, abs=1e-9) and down[2] < 0.0
    assert math.hypot(*position[:2]) == pytest.approx(2.0) and position[2] == 1.5


def test_orbit_takes_sixteen_seconds():
    assert orbit.camera_pose(16.0)[0] == pytest.approx(orbit.camera_pose(0.0)[0])
    assert orbit.camera_pose(8.0)[0][0] == pytest.approx(-orbit.camera_pose(0.0)[0][0])


def test_figure_eight_crosses_itself_in_the_middle_and_closes():
    period_s = figure_eight.PERIOD_S
    assert figure_eight.position(0.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert figure_eight.position(period_s / 2) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert figure_eight.position(1.3) == pytest.approx(figure_eight.position(1.3 + period_s))
    points = np.array([figure_eight.position(period_s * share) for share in np.linspace(0.0, 1.0, 400)])
    assert np.ptp(points[:, 1]) == pytest.approx(figure_eight.WIDTH, rel=1e-3)
    assert np.ptp(points[:, 0]) == pytest.approx(figure_eight.HEIGHT, rel=1e-3)
