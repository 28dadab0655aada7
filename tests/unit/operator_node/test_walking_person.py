"""The person of the emulator is one who could be."""

from __future__ import annotations

import numpy as np
import pytest

from operator_node.emulators.walking_person import WalkingPerson
from operator_node.mvn.segments import BONES, INDEX, SEGMENTS

HZ = 60.0


@pytest.fixture(scope="module", params=[(1.75, 0.4), (1.55, 0.6), (1.95, 0.0)], ids=["walks", "is fast", "at rest"])
def walk(request):
    """Positions and orientations over 12 s, with height and speed."""
    height_m, speed = request.param
    person = WalkingPerson(height_m, speed, t_pose_s=1.0)
    poses = [person.pose(number / HZ) for number in range(round(12 * HZ))]
    return height_m, speed, *map(np.array, zip(*poses))


def test_the_t_pose_is_one():
    positions, quats = WalkingPerson(1.8, t_pose_s=1.0).pose(0.5)
    np.testing.assert_allclose(np.abs(quats[:, 3]), 1.0, atol=1e-9)
    span = positions[INDEX["LeftHand"]] - positions[INDEX["RightHand"]]
    np.testing.assert_allclose(span, (0.0, 2 * 0.442 * 1.8, 0.0), atol=1e-9)
    assert positions[INDEX["Head"]][2] == pytest.approx(0.87 * 1.8)


def test_bones_are_rigid(walk):
    _, _, positions, quats = walk
    lengths = np.linalg.norm(positions[:, BONES[:, 0]] - positions[:, BONES[:, 1]], axis=2)
    assert np.ptp(lengths, axis=0).max() < 1e-9
    np.testing.assert_allclose(np.linalg.norm(quats, axis=2), 1.0, atol=1e-9)


def test_nothing_jumps(walk):
    height_m, _, positions, quats = walk
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=2) * HZ / height_m
    assert steps.max() < 3.5, SEGMENTS[steps.max(axis=0).argmax()]
    cosines = np.abs(np.einsum("tij,tij->ti", quats[1:], quats[:-1]))
    assert np.degrees(2 * np.arccos(np.clip(cosines, 0, 1))).max() < 15.0


def test_at_least_one_foot_rests_on_the_ground(walk):
    height_m, speed, positions, _ = walk
    feet = positions[:, [INDEX["RightFoot"], INDEX["LeftFoot"]]]
    still = np.linalg.norm(np.diff(feet, axis=0), axis=2) < 1e-9
    assert still.any(axis=1).all()
    assert feet[..., 2].min() == pytest.approx(0.039 * height_m)
    assert (feet[..., 2].max() > 0.08 * height_m) == (speed > 0)


def test_the_person_gets_somewhere_and_reaches_with_both_hands(walk):
    height_m, speed, positions, _ = walk
    way_m = np.linalg.norm(np.diff(positions[:, 0, :2], axis=0), axis=1).sum()
    assert way_m == pytest.approx(speed * height_m * (11.0 - 0.8 - 1.5), rel=0.05, abs=0.05)
    for side in ("Right", "Left"):
        reach = np.linalg.norm((positions[:, INDEX[f"{side}Hand"]] - positions[:, 0])[:, :2], axis=1)
        assert reach[120:].max() > 0.28 * height_m
