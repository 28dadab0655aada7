"""Demonstrations that cannot be learned from are named, with what is wrong and where."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from shown_motions import reach

from custom_ros_tools.errors import UnknownNameError
from motion_primitives import Demonstration, make_primitive
from motion_primitives.errors import DemonstrationError

TIMES = np.linspace(0.0, 1.0, 21)
PATH = np.outer(TIMES, [1.0, 2.0, 3.0])
QUATS = np.tile([0.0, 0.0, 0.0, 1.0], (21, 1))


def changed(array: np.ndarray, index: object, value: object) -> np.ndarray:
    copy = array.copy()
    copy[index] = value
    return copy


@pytest.mark.parametrize(
    "arguments, text",
    [
        (([0.0, 1.0], PATH[:2]), "times: expected at least 10 samples, got 2"),
        ((changed(TIMES, 7, TIMES[6]), PATH), r"in sample \[7\], which repeats from 0.3 s"),
        ((changed(TIMES, 7, 0.1), PATH), r"0.1 s in sample \[7\], which runs back from 0.3 s"),
        ((changed(TIMES, slice(10, None), TIMES[10:] + 0.5), PATH), r"no jump, got 0.55 s after sample \[9\]"),
        ((changed(TIMES, 3, np.nan), PATH), r"times: expected finite numbers, got nan in sample \[3\]"),
        ((TIMES, changed(PATH, (4, 1), np.inf)), r"positions: expected finite numbers, got .* in sample \[4\]"),
        ((TIMES, PATH[:20]), "positions: expected 21 samples, as many as times, got 20"),
        ((TIMES, PATH[:, 0]), r"positions: expected an array of 2 dimensions, got shape \(21,\)"),
        ((TIMES, PATH[:, :0]), "positions: expected an array of 2 dimensions"),
        ((TIMES, [[1.0], [1.0, 2.0]]), "positions: expected numbers, as many in each row"),
        ((TIMES, PATH, QUATS[:, :3]), "orientations: expected quaternions x, y, z, w, got 3 numbers each"),
        ((TIMES, PATH, QUATS[:5]), "orientations: expected 21 samples"),
        ((TIMES, PATH, changed(QUATS, (2, 3), 0.0)), r"length 1, got length 0 in sample \[2\]"),
        ((TIMES, PATH, changed(QUATS, slice(9, None), [1.0, 0, 0, 0])), r"3.14 rad before sample \[9\]"),
        ((TIMES, PATH, None, ("a", "b")), r"positions: expected one column for each of a, b, got shape \(21, 3\)"),
        ((TIMES, PATH, None, ("a", "b", "a")), "one column for each of a, b, a"),
    ],
)
def test_invalid_demonstrations_are_refused_with_a_reason(arguments, text):
    with pytest.raises(DemonstrationError, match=text):
        Demonstration.of(*arguments)


@pytest.mark.parametrize("sample", [0, 1, 50, 99])
def test_a_spike_of_a_position_is_refused(sample):
    times = np.linspace(0.0, 1.0, 100)
    path = np.outer(np.sin(0.5 * np.pi * times) ** 2, [0.4, 0.2, 0.0])
    path[sample] += [0.0, 0.0, 0.1]
    with pytest.raises(DemonstrationError, match=r"positions: expected at most .* got a spike or jump of 0.[01]"):
        Demonstration.of(times, path)


def test_quick_and_noisy_motions_are_no_spikes():
    times = np.linspace(0.0, 1.0, 100)
    rng = np.random.default_rng(5)
    corner = np.abs(times[::10] - 0.5)
    burst = np.clip((times - 0.5) * 30.0, 0.0, 1.0)
    for stamps, path in (
        (times, rng.normal(0.0, 0.002, 100)),
        (times[::10], corner),
        (times, burst),
        (times, np.round(16.0 * times) / 16.0),
        (times, np.zeros(100)),
    ):
        assert Demonstration.of(stamps, path[:, None]).points.shape == (len(stamps), 1)


def test_the_sign_of_a_quaternion_does_not_matter():
    flipped = QUATS * np.where(np.arange(21) % 2, -1.0, 1.0)[:, None]
    plans = [make_primitive("dmp", {}).learn(Demonstration.of(TIMES, PATH, quats)).plan() for quats in (QUATS, flipped)]
    turns = [np.abs(plan.quats_xyzw[:, 3]) for plan in plans]
    assert turns[0] == pytest.approx(turns[1], abs=1e-12) and turns[0] == pytest.approx(1.0, abs=1e-9)


def test_tables_of_bags():
    index = pd.Index(TIMES + 5.0, name="time")
    joints = pd.DataFrame({"position/a": PATH[:, 0], "position/b": PATH[:, 1], "velocity/a": 0.0}, index)
    assert Demonstration.of_joints(joints).space.names == ("a", "b")
    demonstration = Demonstration.of_joints(joints, ["b"])
    assert demonstration.times[0] == 0.0 and (demonstration.points[:, 0] == PATH[:, 1]).all()
    with pytest.raises(UnknownNameError, match="unknown joint 'c': known are a, b"):
        Demonstration.of_joints(joints, ["c"])
    columns = {f"translation/{axis}": PATH[:, i] for i, axis in enumerate("xyz")}
    columns |= {f"rotation/{axis}": QUATS[:, i] for i, axis in enumerate("xyzw")}
    tf = pd.DataFrame({"parent": "world", "child": "tip", **columns}, index)
    assert Demonstration.of_frame(tf, "world", "tip").points.shape == (21, 7)
    assert Demonstration.of_frame(tf, "world", "tip", orientation=False).points.shape == (21, 3)
    with pytest.raises(UnknownNameError, match="unknown transform 'world -> tool': known are world -> tip"):
        Demonstration.of_frame(tf, "world", "tool")


def test_demonstrations_that_do_not_go_together():
    with pytest.raises(DemonstrationError, match="demonstrations: expected at least one, got none"):
        make_primitive("promp", {}).learn([])
    with pytest.raises(DemonstrationError, match=r"x, y, z, qx, .* as in the first one, got x, y, z in \[1\]"):
        make_primitive("dmp", {}).learn([reach(), reach(orientation=False)])


@pytest.mark.parametrize("name", ["dmp", "promp"])
def test_a_whole_turn_is_too_much_for_one_primitive(name):
    angle = np.linspace(0.0, 2.0 * np.pi, 101)
    quats = np.stack([0 * angle, 0 * angle, np.sin(angle / 2), np.cos(angle / 2)], axis=1)
    turn = Demonstration.of(np.linspace(0.0, 5.0, 101), np.zeros((101, 3)), quats)
    with pytest.raises(DemonstrationError, match=r"orientations: expected at most 2.98 rad"):
        make_primitive(name, {}).learn(turn)


def test_a_motion_that_does_not_repeat_has_no_rhythm():
    with pytest.raises(DemonstrationError, match="expected a motion that repeats"):
        make_primitive("rhythmic_dmp", {}).learn(reach())
    with pytest.raises(DemonstrationError, match=r"at least a period of 20 s, got 10 s in \[0\]"):
        make_primitive("rhythmic_dmp", {"period_s": 20.0}).learn(reach())
