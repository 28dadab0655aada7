"""The motions of the camera examples."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rendering import rotation_matrix

from rpbi_examples.motions import TARGET_HEIGHT, FigureEight, camera_pose


@pytest.mark.parametrize("time_s", [0.0, 3.0, 11.0])
def test_orbiting_camera_faces_its_target_with_a_level_horizon(time_s):
    position, quat_xyzw = camera_pose(time_s)
    right, down, forward = rotation_matrix(quat_xyzw).T
    towards = np.array([0.0, 0.0, TARGET_HEIGHT]) - position
    assert forward == pytest.approx(towards / np.linalg.norm(towards))
    assert right[2] == pytest.approx(0.0, abs=1e-9) and down[2] < 0.0
    assert math.hypot(*position[:2]) == pytest.approx(2.0) and position[2] == 1.5


def test_orbit_takes_sixteen_seconds():
    assert camera_pose(16.0)[0] == pytest.approx(camera_pose(0.0)[0])
    assert camera_pose(8.0)[0][0] == pytest.approx(-camera_pose(0.0)[0][0])


def test_figure_eight_crosses_itself_in_the_middle_and_closes():
    figure = FigureEight(width=0.8, height=0.4, period_s=8.0)
    period_s = figure.period_s
    assert figure.position(0.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert figure.position(period_s / 2) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert figure.position(1.3) == pytest.approx(figure.position(1.3 + period_s))
    points = np.array([figure.position(period_s * share) for share in np.linspace(0.0, 1.0, 400)])
    assert np.ptp(points[:, 1]) == pytest.approx(figure.width, rel=1e-3)
    assert np.ptp(points[:, 0]) == pytest.approx(figure.height, rel=1e-3)


def test_default_figure_eight_is_the_one_controllers_were_written_for():
    for time_s in (0.0, 0.4, 3.1, 7.7):
        x, y = 0.1 * math.sin(0.4 * math.pi * time_s), 0.2 * math.sin(0.2 * math.pi * time_s)
        assert FigureEight().position(time_s) == pytest.approx((x, y, 0.0))


def test_frames_of_a_figure_eight_are_named_after_its_namespace():
    assert FigureEight().frame("figure_eight") == "figure_eight"
    assert FigureEight(tf_ns="/rpbi/").frame("figure_eight") == "rpbi/figure_eight"
