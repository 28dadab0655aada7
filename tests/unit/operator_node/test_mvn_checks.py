"""Faults that a stream may have though its datagrams are fine: each is named, and a healthy stream is left in peace."""

from __future__ import annotations

import numpy as np
import pytest
from mvn_stream import HZ, suit

from operator_node.emulators.walking_person import WalkingPerson
from operator_node.mvn.checks import FrameChecks
from operator_node.mvn.segments import INDEX, SegmentFrame
from operator_node.mvn.stream import StreamDecoder

SECONDS = 2.0
HALF = round(SECONDS * HZ / 2)
Y_UP = [1, 2, 0]
HAND = INDEX["RightHand"]


def both(change):
    """Returns a fault of every frame."""
    return lambda p, q, n, first: change(p, q)


def one(n, value, values):
    """Returns values, of which row n is another."""
    values = values.copy()
    values[n] = value
    return values


def after(change):
    """Returns a fault of the second half."""
    return lambda p, q, n, first: change(p, q, first) if n >= HALF else (p, q)


def at_half(change):
    """Returns a fault of one frame."""
    return lambda p, q, n, first: change(p, q) if n == HALF else (p, q)


SWAPPED = [*range(7), *range(11, 15), *range(7, 11), *range(19, 23), *range(15, 19)]
FAULTS = {
    "centimetres": (both(lambda p, q: (100 * p, q)), "centimetres, set position_scale: 0.01"),
    "millimetres": (both(lambda p, q: (1000 * p, q)), "millimetres, set position_scale: 0.001"),
    "inches": (both(lambda p, q: (p / 0.0254, q)), "inches, set position_scale: 0.0254"),
    "scaled twice": (both(lambda p, q: (p / 100, q)), "pelvis and head are 0.0"),
    "xyzw": (both(lambda p, q: (p, q[:, [1, 2, 3, 0]])), "come as x, y, z, w instead of w, x, y, z"),
    "y up": (both(lambda p, q: (p[:, Y_UP], q[:, [*Y_UP, 3]])), "the stream is Y-up: set y_up: true"),
    "positions y up": (both(lambda p, q: (p[:, Y_UP], q)), "positions alone are Y-up"),
    "orientations y up": (both(lambda p, q: (p, q[:, [*Y_UP, 3]])), "orientations alone are Y-up"),
    "x and y swapped": (both(lambda p, q: (p[:, [1, 0, 2]], q)), "axes x and y of positions are swapped"),
    "y and z swapped": (both(lambda p, q: (p[:, [0, 2, 1]], q)), "axes y and z of positions are swapped"),
    "y reversed": (both(lambda p, q: (p * (1, -1, 1), q)), "axis y of positions is reversed"),
    "z reversed": (both(lambda p, q: (p * (1, 1, -1), q)), "axis z of positions is reversed"),
    "inverted": (both(lambda p, q: (p, q * (-1, -1, -1, 1))), "quaternions are inverted"),
    "left for right": (both(lambda p, q: (p[SWAPPED], q[SWAPPED])), "left and right are swapped"),
    "turned": (after(lambda p, q, first: (p, one(3, (0, 1, 0, 0), q))), "T8 is"),
    "stuck segment": (after(lambda p, q, first: (p, one(HAND, first[1][HAND], q))), "RightHand has not turned at all"),
    "stuck stream": (after(lambda p, q, first: first), "the same frame is repeated"),
    "hand jumps": (at_half(lambda p, q: (one(HAND, p[HAND] + (0, 0, 1), p), q)), "RightHand moved by 1.0"),
    "all jumps": (at_half(lambda p, q: (p + (2, 0, 0), q)), "the whole person moved by 2.0"),
    "hand flips": (
        at_half(lambda p, q: (p, one(HAND, q[HAND][[3, 2, 1, 0]] * (1, 1, -1, -1), q))),
        "RightHand turned by 180",
    ),
    "bone grows": (after(lambda p, q, first: (one(HAND, p[HAND] + (0, 0, 0.15), p), q)), "bones are rigid"),
    "57.3": (both(lambda p, q: (p, 57.3 * q)), "length 57.3 instead of 1"),
    "not finite": (at_half(lambda p, q: (one(HAND, np.nan, p), q)), "numbers that are not finite"),
    "zero": (at_half(lambda p, q: (p, one(HAND, 0.0, q))), "a quaternion is zero: segment RightHand"),
    "out of range": (at_half(lambda p, q: (one(HAND, 1e9, p), q)), "a number is larger than"),
}


def named(fault, seed: int) -> set[str]:
    """Returns all that is said of two seconds of somebody's stream with a fault."""
    generator = np.random.default_rng(seed)
    person = WalkingPerson(generator.uniform(1.5, 2.0), generator.uniform(0.0, 0.6), t_pose_s=0.0)
    begin_s = generator.uniform(1.5, 10.0)
    sender, decoder, checks, said, first = (
        suit(moves=person, noise_rad=2e-4),
        StreamDecoder(),
        FrameChecks(),
        set(),
        None,
    )
    for number in range(round(SECONDS * HZ) + 10):
        time_s = begin_s + number / HZ
        positions, quats = sender.pose(time_s)
        if number == HALF:
            first = positions, quats
        frame = decoder.decode(*sender.frame(number, time_s, *fault(positions, quats, number, first)))
        if isinstance(frame, SegmentFrame):
            said |= {message for _, message in checks.check(frame, number / HZ)}
        said |= {*decoder.remarks.values(), *decoder.refusals.values()}
    return said


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_named(fault):
    change, words = FAULTS[fault]
    said = named(change, seed=list(FAULTS).index(fault))
    assert any(words in each for each in said), said


@pytest.mark.parametrize("seed", range(5))
def test_of_a_healthy_stream_nothing_is_said(seed):
    assert named(lambda p, q, n, first: (p, q), seed) == set()


def test_time_that_goes_back_is_named():
    sender, decoder, checks = suit(), StreamDecoder(), FrameChecks()
    for sample, time_s in ((1, 2.0), (2, 1.0)):
        findings = checks.check(decoder.decode(*sender.datagrams(sample, time_s)), 0.01 * sample)
    assert ("time", "went back by 1 s, from 2000 ms") in findings


def test_gap_between_two_frames_is_not_a_jump():
    sender, decoder, checks = suit(), StreamDecoder(), FrameChecks()
    for sample in (60, 120):
        assert checks.check(decoder.decode(*sender.datagrams(sample, sample / HZ)), sample / HZ) == []
