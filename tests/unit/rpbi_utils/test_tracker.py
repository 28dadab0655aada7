"""Poses of tracked objects: smoothed in true time, outliers left out, gaps survived."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from custom_ros_tools.errors import ConfigError
from robot_model.geometry import Pose, rotation_between
from rpbi_utils.tracking.config import AprilTagNodeConfig, TrackingNodeConfig
from rpbi_utils.tracking.tracker import OneEuroPose, OutlierConfig, OutlierError, PoseTracker, SmoothingConfig

DT_S = 0.01


def tracker(smoothing: dict[str, float] | None = None, **outliers: float) -> PoseTracker:
    """Returns a tracker that does not smooth unless it is told to."""
    config = {"min_cutoff_hz": 0.0} if smoothing is None else smoothing
    return PoseTracker(SmoothingConfig(**config), OutlierConfig(**outliers), timeout_s=0.5)


def turned(angle: float) -> tuple[float, float, float, float]:
    """Returns a rotation about z [rad]."""
    return 0.0, 0.0, math.sin(angle / 2.0), math.cos(angle / 2.0)


def at(x: float, angle: float = 0.0) -> Pose:
    """Returns a pose on the x axis."""
    return Pose((x, 0.0, 0.0), turned(angle))


def test_noise_at_rest_is_smoothed_and_motion_is_hardly_late() -> None:
    draw = np.random.default_rng(1)
    resting, moving = OneEuroPose(SmoothingConfig()), OneEuroPose(SmoothingConfig())
    still = [resting.step(at(*draw.normal(0.0, 0.001, 2)), DT_S) for _ in range(1000)]
    assert np.std([pose.position[0] for pose in still[100:]]) < 0.5 * 0.001
    assert np.std([rotation_between(turned(0.0), pose.quat_xyzw)[2] for pose in still[100:]]) < 0.5 * 0.001
    for index in range(200):
        last = moving.step(at(0.5 * index * DT_S, 1.0 * index * DT_S), DT_S)
    assert 0.0 < 0.5 * 199 * DT_S - last.position[0] < 0.5 * 0.02, "less than 20 ms late at 0.5 m/s"
    assert 0.0 < rotation_between(last.quat_xyzw, turned(199 * DT_S))[2] < 1.0 * 0.03


def test_filter_depends_on_the_time_between_samples() -> None:
    """A step is answered alike at 100 Hz, at 1 kHz, and where every third sample is missing."""
    constant = SmoothingConfig(min_cutoff_hz=1.0, per_speed=0.0, per_angular_speed=0.0)
    answers = []
    for intervals in ([0.01] * 30, [0.001] * 300, [0.01, 0.02] * 10):
        euro = OneEuroPose(constant)
        euro.step(at(0.0), 0.01)
        for dt_s in intervals:
            pose = euro.step(at(1.0, 1.0), dt_s)
        answers.append((pose.position[0], rotation_between(turned(0.0), pose.quat_xyzw)[2]))
    assert answers[0] == pytest.approx([1.0 - math.exp(-2.0 * math.pi * 0.3)] * 2)
    assert answers[1:] == [pytest.approx(answers[0], rel=1e-5)] * 2


def test_signs_of_quaternions_do_not_matter() -> None:
    euro = OneEuroPose(SmoothingConfig())
    euro.step(at(0.0, 0.1), DT_S)
    flipped = Pose((0.0, 0.0, 0.0), tuple(-each for each in turned(0.1)))
    assert math.hypot(*rotation_between(turned(0.1), euro.step(flipped, DT_S).quat_xyzw)) < 1e-7


def test_an_outlier_is_left_out_and_named() -> None:
    one = tracker()
    assert one.observe(at(0.0), 0.0) == at(0.0)
    with pytest.raises(OutlierError, match="^outlier: 0.5 m in 0.01 s is more than max_speed 5 m/s allows$"):
        one.observe(at(0.5), 0.01)
    with pytest.raises(OutlierError, match="^outlier: 3 rad in 0.02 s is more than max_angular_speed 20 rad/s allows$"):
        one.observe(at(0.0, 3.0), 0.02)
    assert one.observe(at(0.01), 0.03) == at(0.01)


def test_where_it_stays_is_where_it_is() -> None:
    one = tracker(in_a_row=3)
    one.observe(at(0.0), 0.0)
    for stamp_s, x in ((0.01, 1.0), (0.02, 2.0), (0.03, 2.01)):  # the first does not agree with those after it
        with pytest.raises(OutlierError):
            one.observe(at(x), stamp_s)
    assert one.observe(at(2.02), 0.04) == at(2.02)
    assert tracker(in_a_row=1).observe(at(0.0), 0.0) == at(0.0)
    free = tracker(in_a_row=1)
    free.observe(at(0.0), 0.0)
    assert free.observe(at(9.0), 0.01) == at(9.0), "none is left out"


def test_after_a_gap_and_on_another_clock_it_begins_anew() -> None:
    one = tracker({"min_cutoff_hz": 0.1, "per_speed": 0.0})
    one.observe(at(0.0), 10.0)
    assert one.observe(at(0.02), 10.1) != at(0.02)
    assert one.observe(at(3.0), 10.7) == at(3.0), "unseen for longer than timeout_s"
    assert one.observe(at(5.0), 1.0) == at(5.0), "time has gone back"
    assert one.observe(at(5.0), 1.0) is None and one.observe(at(5.0), 0.9) is None, "known, or older"


OBJECT = {"name": "box", "vicon": "box/box"}


@pytest.mark.parametrize(
    ("objects", "told"),
    [
        ([], "objects: expected at least one object"),
        ([{"name": "box"}], "objects[0].vicon: an object is seen by either vicon or april_tag"),
        ([{**OBJECT, "april_tag": 1}], "objects[0].vicon: an object is seen by either"),
        ([{"name": "box", "vicon": "box"}], "objects[0].vicon: expected SUBJECT/SEGMENT, got 'box'"),
        ([{**OBJECT, "topics": ["tags"]}], "objects[0].topics: expected at least one, with april_tag only"),
        ([{"name": "box", "april_tag": 1, "topics": []}], "objects[0].topics: expected at least one"),
        ([{"name": "box", "april_tag": 1, "topics": ["a b"]}], "objects[0].topics[0]: expected the name of a topic"),
        ([OBJECT, OBJECT], "objects[1].name: 'box' is the name of another object"),
        ([{**OBJECT, "name": "/box"}], "objects[0].name: a TF frame has no spaces and neither starts"),
        ([{**OBJECT, "unit": "cm"}], "objects[0].unit: must be 'm' or 'mm', got text 'cm'"),
        ([{**OBJECT, "orientation": [0, 0, 0, 0]}], "objects[0].orientation: a quaternion cannot be all zeros"),
    ],
)
def test_faulty_objects_are_named(objects: list[dict[str, Any]], told: str) -> None:
    with pytest.raises(ConfigError) as caught:
        TrackingNodeConfig.parse({"objects": objects}, "~config")
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("tags", "told"),
    [
        ([{"id": 587, "size": 0.1}], "standalone_tags[0].id: tag36h11 has ids below 587, got 587"),
        ([{"id": 1, "size": 0.1}] * 2, "standalone_tags[1].id: 1 is the id of another tag"),
        ([{"id": 1, "size": 0.0}], "standalone_tags[0].size: must be > 0 [m], got 0"),
    ],
)
def test_faulty_tags_are_named(tags: list[dict[str, Any]], told: str) -> None:
    with pytest.raises(ConfigError) as caught:
        AprilTagNodeConfig.parse({"standalone_tags": tags}, "~config")
    assert told in str(caught.value)


def test_a_tag_is_one_or_a_bundle() -> None:
    objects = [{"name": "one", "april_tag": 3}, {"name": "many", "april_tag": [5, 4]}]
    parsed = TrackingNodeConfig.parse({"objects": objects}, "~config").objects
    assert [each.tag_ids for each in parsed] == [(3,), (4, 5)]
