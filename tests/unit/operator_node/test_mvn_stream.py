"""Datagrams of MVN become frames, and whatever else comes is counted and named."""

from __future__ import annotations

import random
import struct
from collections import defaultdict

import numpy as np
import pytest
from mvn_stream import HZ, T_POSE, WALKER, assert_same, broken_datagram, suit, truth

from operator_node.emulators.mvn_suit import KINDS, BadNetwork
from operator_node.mvn import packets
from operator_node.mvn.segments import (
    SEGMENTS,
    CenterOfMass,
    JointAngles,
    PersonInfo,
    SegmentFrame,
    SegmentMotion,
    TimeCode,
    TPose,
)
from operator_node.mvn.stream import LONG_GONE, MAX_LATE, StreamDecoder

FUZZED = 100_000
"""How many broken datagrams are tried."""
ENDS = ("late", "duplicate", "incomplete", "ignored", "used")


def settled(decoder: StreamDecoder) -> int:
    """Returns how many datagrams are accounted for."""
    counts = decoder.counts
    return sum(counts[end] for end in ENDS) + sum(n for key, n in counts.items() if key.startswith("refused: "))


def by_hand(*, kind=b"02", sample=7, counter=0x80, count=23, time_ms=1234, person=3, size=736, items=None):
    """Returns a datagram written from the table of the protocol, without any code of the suit's."""
    header = b"MXTP" + kind + sample.to_bytes(4, "big") + bytes([counter, count]) + time_ms.to_bytes(4, "big")
    header += bytes([person, 23, 0, 0, 0, 0]) + size.to_bytes(2, "big")
    one = b"\x3f\x80\x00\x00"  # 1.0
    zero, half = b"\x00" * 4, b"\x3f\x00\x00\x00"
    if items is None:
        items = [number.to_bytes(4, "big") + one + half + zero + one + zero * 3 for number in range(1, 24)]
    return header + b"".join(items)


def test_handwritten_datagram_of_760_bytes_becomes_a_frame():
    data = by_hand()
    assert len(data) == 760
    frame = StreamDecoder().decode(data)
    assert frame[:3] == (3, 7, 1234)
    np.testing.assert_array_equal(frame.positions, [[1.0, 0.5, 0.0]] * 23)
    np.testing.assert_array_equal(frame.quats_xyzw, [[0.0, 0.0, 0.0, 1.0]] * 23)


def test_emulated_suit_writes_the_handwritten_datagram():
    ours = suit(3).frame(7, 1.234, np.tile([1.0, 0.5, 0.0], (23, 1)), np.tile([0.0, 0.0, 0.0, 1.0], (23, 1)))
    assert ours == [by_hand()]


def test_older_streams_have_no_counts_and_no_sizes():
    data = bytearray(by_hand(size=0))
    data[17] = 0
    assert isinstance(StreamDecoder().decode(bytes(data)), SegmentFrame)


@pytest.mark.parametrize("kind", [1, 2])
@pytest.mark.parametrize("items", [255, 8, 1])
def test_poses_are_those_of_the_person_however_they_are_cut(kind, items):
    decoder, sender = StreamDecoder(), suit(kinds=(kind,), items=items)
    for sample in range(0, 600, 60):
        datagrams = sender.datagrams(sample, sample / HZ)
        assert len(datagrams) == {255: 1, 8: 3, 1: 23}[items]
        random.Random(sample).shuffle(datagrams)
        (frame,) = [each for each in map(decoder.decode, datagrams) if each is not None]
        assert_same(frame, truth(sample), 3e-6)


def test_positions_are_scaled_and_y_up_is_turned():
    expected = truth(30)
    y_up = suit().frame(30, 0.5, 100.0 * expected.positions[:, [1, 2, 0]], expected.quats_xyzw[:, [1, 2, 0, 3]])
    assert_same(StreamDecoder(position_scale=0.01, y_up=True).decode(*y_up), expected)


def test_quaternions_of_another_length_are_normalised_and_named():
    decoder, expected = StreamDecoder(), truth(30)
    assert_same(decoder.decode(*suit().frame(30, 0.5, expected.positions, 57.3 * expected.quats_xyzw)), expected)
    assert "length 57.3" in decoder.remarks["quaternions"]


def test_props_and_fingers_after_the_body_are_left_out():
    items = [struct.pack(">i7f", number, *[number / 10] * 3, 1, 0, 0, 0) for number in range(1, 24 + 4 + 40)]
    data = bytearray(by_hand(count=67, size=67 * 32, items=items))
    data[18:20] = 4, 40
    np.testing.assert_allclose(StreamDecoder().decode(bytes(data)).positions[:, 0], np.arange(1, 24) / 10, rtol=1e-6)


def test_everything_else_that_mvn_streams():
    decoder = StreamDecoder()
    found = [
        decoder.decode(data) for data in suit(moves=T_POSE, kinds=(12, 13, 20, 21, 22, 24, 25)).datagrams(60, 62.5)
    ]
    info, t_pose, angles, motion, turning, center, time = found
    assert info == PersonInfo(0, {"name": "Person0", "xmid": "emulator", "color": "3070B0"})
    assert isinstance(t_pose, TPose) and tuple(t_pose.origins) == SEGMENTS
    np.testing.assert_allclose(list(t_pose.origins.values()), T_POSE.t_pose, atol=1e-6)
    assert isinstance(angles, JointAngles) and angles.angles_rad.shape == (22, 3)
    assert ("RightUpperArm", "RightForeArm") in zip(angles.parents, angles.children)
    np.testing.assert_allclose(angles.angles_rad, 0.0, atol=1e-6)
    assert isinstance(motion, SegmentMotion) and motion.values.shape == (23, 9) and motion.ids == tuple(range(1, 24))
    np.testing.assert_allclose(motion.values[:, 3:], 0.0, atol=1e-6)
    assert turning.kind == 22 and turning.values.shape == (23, 10)
    assert isinstance(center, CenterOfMass) and 0.9 < center.position[2] < 1.1
    assert time == TimeCode(0, 60, "00:01:02.500")
    assert settled(decoder) == len(found)


def test_bent_joints_have_the_angles_by_which_they_are_bent():
    """In the middle of a reach, by the angle between upper arm and forearm."""
    moves, sample = WALKER, round((1.5 + 1.25) * HZ)
    angles = StreamDecoder().decode(*suit(moves=moves, kinds=(20,)).datagrams(sample, sample / HZ))
    at = list(zip(angles.parents, angles.children)).index(("RightUpperArm", "RightForeArm"))
    p = truth(sample, moves=moves).positions
    upper, fore = p[9] - p[8], p[10] - p[9]
    bend = np.arccos(upper @ fore / np.linalg.norm(upper) / np.linalg.norm(fore))
    assert bend == pytest.approx(abs(angles.angles_rad[at, 2]), abs=1e-5) and bend > 0.2


def test_poses_of_type_02_win_over_those_of_type_01():
    decoder, sender = StreamDecoder(), suit(kinds=(2, 1))
    for sample in range(5):
        assert [bool(decoder.decode(data)) for data in sender.datagrams(sample, sample / HZ)] == [True, False]
    assert decoder.counts["ignored"] == 5


def test_several_people_are_kept_apart():
    decoder, suits = StreamDecoder(), [suit(person, items=8) for person in range(3)]
    for sample in range(10):
        datagrams = [data for each in suits for data in each.datagrams(sample, sample / HZ)]
        random.Random(sample).shuffle(datagrams)
        frames = [frame for frame in map(decoder.decode, datagrams) if frame is not None]
        assert sorted(frame.person for frame in frames) == [0, 1, 2]
        for frame in frames:
            assert_same(frame, truth(sample, frame.person))


class TestBadNetwork:
    """1 % of the datagrams each are lost, repeated, cut and swapped."""

    @pytest.fixture(params=[(255, 1), (8, 2), (8, 3)], ids=lambda each: f"{each[0]} items, seed {each[1]}")
    def arrived(self, request):
        items, seed = request.param
        network, sender = BadNetwork(0.01, 0.01, 0.01, 0.01, seed=seed), suit(items=items)
        samples = 1200
        sent = [each for n in range(samples) for each in network.transmit(sender.datagrams(n, n / HZ))]
        assert min(network.done[what] for what in ("lost", "duplicate", "truncated", "reordered")) > 0
        return network, samples, sent, 1 if items == 255 else 3

    def test_no_frame_is_wrong_and_all_is_counted(self, arrived):
        network, samples, sent, parts = arrived
        decoder = StreamDecoder()
        frames = [frame for each in sent if (frame := decoder.decode(each.data)) is not None]
        for frame in frames:
            assert_same(frame, truth(frame.sample))

        # What became of each datagram, by the order of arrival alone: whole ones, and when a newer sample first came.
        whole = [
            (at, *struct.unpack_from(">IB", each.data, 6)) for at, each in enumerate(sent) if each.fault != "truncated"
        ]
        newest, newer_at = -1, defaultdict(lambda: len(sent))
        for at, sample, _ in whole:
            for passed in range(newest, sample) if sample > newest else ():
                newer_at[passed] = at
            newest = max(newest, sample)
        in_time = [each for each in whole if each[0] < newer_at[each[1]]]
        firsts = {(sample, counter) for _, sample, counter in in_time}
        complete = [n for n in range(samples) if sum(sample == n for sample, _ in firsts) == parts]
        repeats = len(in_time) - len(firsts)
        refused = sum(count for key, count in decoder.counts.items() if key.startswith("refused: "))

        assert [frame.sample for frame in frames] == complete
        assert decoder.counts["frames"] == len(complete) > 0.85 * samples
        assert decoder.counts["used"] == parts * len(complete)
        assert refused == network.done["truncated"]
        assert decoder.counts["late"] == len(whole) - len(in_time)
        assert decoder.counts["duplicate"] == repeats
        assert decoder.counts["incomplete"] + decoder.waiting == len(firsts) - parts * len(complete)
        assert decoder.counts["received"] == len(sent) == settled(decoder) + decoder.waiting
        assert decoder.counts["skipped"] == complete[-1] - complete[0] + 1 - len(complete)


def test_a_stream_that_begins_anew_is_followed():
    decoder, sender = StreamDecoder(), suit()
    for sample in (5000, 5001, 0, 1, 2):
        assert decoder.decode(*sender.datagrams(sample, sample / HZ)).sample == sample
    assert decoder.counts["late"] == 0


def test_short_recording_played_in_a_loop_is_followed():
    decoder, sender = StreamDecoder(), suit()
    taken = [decoder.decode(*sender.datagrams(n % 60, n / HZ)) is not None for n in range(180)]
    assert sum(taken) == 180 - 2 * MAX_LATE


def test_the_counter_may_turn_over():
    decoder, sender = StreamDecoder(), suit()
    for sample in (2**32 - 2, 2**32 - 1, 0, 1):
        assert decoder.decode(*sender.datagrams(sample, 1.0)).sample == sample
    assert decoder.counts["skipped"] == decoder.counts["late"] == 0


def test_sample_number_from_far_ahead_does_not_lock_the_stream():
    decoder, sender = StreamDecoder(), suit()
    assert decoder.decode(*sender.datagrams(10, 0.1))
    assert decoder.decode(*sender.datagrams(2**31, 0.1))
    assert decoder.decode(*sender.datagrams(11, 0.1))


BROKEN = {
    "too short": by_hand()[:23],
    "not MVN": b"XXTP02" + by_hand()[6:],
    "type 05": by_hand(kind=b"05"),
    "unknown type": by_hand(kind=b"04"),
    "size": by_hand()[:-4],
    "counts": by_hand(count=0),
    "segment ids": by_hand(items=[struct.pack(">i7f", 1, 0, 0, 0, 1, 0, 0, 0)] * 23),
    "not finite": by_hand(items=[struct.pack(">i7f", n, 0, float("nan"), 0, 1, 0, 0, 0) for n in range(1, 24)]),
    "zero quaternion": by_hand(items=[struct.pack(">i7f", n, *[0] * 7) for n in range(1, 24)]),
    "out of range": by_hand(items=[struct.pack(">i7f", n, 3e38, 0, 0, 1, 0, 0, 0) for n in range(1, 24)]),
    "text": by_hand(kind=b"25", size=4, items=[b"noon"]),
}


@pytest.mark.parametrize("reason", BROKEN)
def test_unusable_datagrams_are_refused_with_their_reason(reason):
    decoder = StreamDecoder()
    assert decoder.decode(BROKEN[reason]) is None
    assert decoder.counts[f"refused: {reason}"] == 1
    assert packets.REASONS[reason] in decoder.refusals[reason] and [*decoder.refused] == [reason]
    assert isinstance(decoder.decode(by_hand(sample=8)), SegmentFrame)


def test_more_people_than_allowed_are_refused():
    decoder = StreamDecoder(max_people=2)
    assert [bool(decoder.decode(by_hand(person=person))) for person in (4, 9, 5, 4)] == [True, True, False, False]
    assert decoder.counts["refused: too many people"] == 1 and decoder.counts["duplicate"] == 1


def test_invented_people_do_not_block_a_persistent_person():
    decoder = StreamDecoder(max_people=2)
    for person in (7, 8):
        decoder.decode(*suit(person, kinds=(12,)).datagrams(0, 0.0))
    taken = [decoder.decode(by_hand(sample=sample)) is not None for sample in range(2 * LONG_GONE)]
    assert taken == [False] * (LONG_GONE - 2) + [True] * (LONG_GONE + 2)


@pytest.mark.filterwarnings("error")
def test_broken_datagrams_raise_no_error_and_give_only_finite_values():
    """Bits, bytes and whole fields change at random, in datagrams of all types."""
    generator = random.Random(5)
    good = [data for n in (0, 60) for data in suit(kinds=KINDS, items=9).datagrams(n, n / HZ)]
    decoder, messages = StreamDecoder(max_people=4), 0
    for number in range(FUZZED):
        message = decoder.decode(broken_datagram(generator, bytearray(generator.choice(good))))
        messages += message is not None
        for part in message or ():
            assert not isinstance(part, np.ndarray) or np.isfinite(part).all(), (number, message)
        if isinstance(message, SegmentFrame):
            np.testing.assert_allclose(np.linalg.norm(message.quats_xyzw, axis=1), 1.0, atol=1e-6)
        assert decoder.waiting <= 4 * len(packets.ITEMS) * 128
    assert decoder.counts["received"] == FUZZED == settled(decoder) + decoder.waiting
    refused = {key for key in decoder.counts if key.startswith("refused: ")}
    assert messages > 0 and len(refused) >= 8, decoder.counts
    assert {key.removeprefix("refused: ") for key in refused} <= set(packets.REASONS)
