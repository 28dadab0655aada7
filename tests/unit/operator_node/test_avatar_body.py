"""The body of the avatar: sizes and masses of the tables, and the URDF that is made of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from custom_ros_tools.config import replace_package
from operator_node.avatar.anthropometry import MASS_PERCENT, leg_length, measured_offsets, segment_offsets
from operator_node.avatar.human_urdf import human_urdf, urdf_offsets
from operator_node.avatar.joints import HINGES, JOINTS, LOWER, UPPER, segment_frame
from operator_node.mvn.segments import PARENTS, SEGMENTS

LEVEL = np.array((0.0, 0.0, 0.0, 1.0))


def test_masses_of_the_segments_are_the_whole_mass():
    assert set(MASS_PERCENT) == set(SEGMENTS)
    assert sum(MASS_PERCENT.values()) == pytest.approx(100.0, abs=1e-9)


@pytest.mark.parametrize("height_m", (1.5, 2.0))
def test_hips_shoulders_and_neck_are_where_the_tables_have_them(height_m):
    hips = np.array((0.0, 0.0, 0.53 * height_m))
    frame = segment_frame(segment_offsets(height_m), hips, LEVEL, {})
    heights = dict(zip(SEGMENTS, frame.positions[:, 2] / height_m))
    assert heights["RightUpperArm"] == heights["LeftUpperArm"] == pytest.approx(0.818)
    assert heights["RightFoot"] == pytest.approx(0.039)
    assert heights["Neck"] == pytest.approx(1.0 - 0.47 * 242.9 / 846.2)
    width = dict(zip(SEGMENTS, frame.positions[:, 1] / height_m))
    assert width["LeftUpperArm"] - width["RightUpperArm"] == pytest.approx(2 * 0.129)


def test_every_segment_but_pelvis_has_a_joint_left_mirrors_right():
    assert [joint.child for joint in JOINTS] == list(SEGMENTS[1:])
    assert len(set(HINGES)) == len(HINGES) == 66
    assert [joint.parent for joint in JOINTS] == [SEGMENTS[parent] for parent in PARENTS[1:]]
    assert (LOWER < 0.0).all() and (UPPER > 0.0).all() and (UPPER - LOWER < 2 * np.pi).all()
    limits = dict(zip(HINGES, zip(LOWER, UPPER)))
    for hinge, (low, high) in limits.items():
        if "Left" in hinge:
            other = limits[hinge.replace("Left", "Right")]
            assert (low, high) == (other if hinge.endswith("y") else (-other[1], -other[0]))


def test_shipped_urdf_equals_the_generated_one():
    shipped = Path(replace_package("{rpbi_examples}/robots/human_model.urdf")).read_text()
    assert shipped == human_urdf(1.75, 75.0)


def test_segment_lengths_are_recovered_from_urdf_and_any_suit_pose():
    offsets = segment_offsets(1.62)
    assert urdf_offsets("her", human_urdf(1.62, 60.0)) == pytest.approx(offsets, abs=1e-6)
    random = np.random.default_rng(1)
    pose = dict(zip(HINGES, random.uniform(LOWER, UPPER)))
    frame = segment_frame(offsets, np.array((1.0, 2.0, 3.0)), np.array((0.5, 0.5, 0.5, 0.5)), pose)
    assert measured_offsets(frame) == pytest.approx(offsets, abs=1e-12)


def test_a_body_is_made_for_measured_lengths():
    offsets = segment_offsets(1.75) * 1.1
    assert urdf_offsets("measured", human_urdf(1.75, 75.0, offsets)) == pytest.approx(offsets, abs=1e-6)
    assert leg_length(offsets) == pytest.approx(1.1 * 0.491 * 1.75)


@pytest.mark.parametrize(
    "arguments, message",
    (
        ((17.5, 75.0), "height: expected 0.5 to 2.5 m, got 17.5"),
        ((float("nan"), 75.0), "height"),
        ((1.75, 0.0), "mass: expected 3 to 300 kg, got 0"),
        ((1.75, 75.0, np.zeros((23, 3))), "from Pelvis to L5, got 0"),
        ((1.75, 75.0, np.ones((22, 3))), "expected 23 x 3 finite numbers"),
    ),
)
def test_impossible_height_or_mass_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        human_urdf(*arguments)


def test_an_unknown_hinge_is_named():
    with pytest.raises(ValueError, match="unknown hinge 'jTail_rotx'"):
        segment_frame(segment_offsets(1.75), np.zeros(3), LEVEL, {"jTail_rotx": 1.0})
