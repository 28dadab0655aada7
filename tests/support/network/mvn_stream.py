"""Streams of MVN for tests."""

from __future__ import annotations

import random
import socket
import struct
from functools import cache

import numpy as np

from operator_node.emulators.mvn_suit import Suit
from operator_node.emulators.walking_person import WalkingPerson
from operator_node.mvn.segments import SegmentFrame

HZ = 60.0
T_POSE = WalkingPerson(1.7, t_pose_s=1e9)
"""Somebody who stays in the T-pose."""
WALKER = WalkingPerson(1.75, t_pose_s=0.0)


def suit(person: int = 0, moves: WalkingPerson = WALKER, **options) -> Suit:
    return Suit(person, moves, **{"noise_rad": 0.0, "hz": HZ, **options})


@cache
def truth(sample: int, person: int = 0, moves: WalkingPerson = WALKER) -> SegmentFrame:
    """Returns the frame of a sample without noise."""
    positions, quats = moves.pose(sample / HZ)
    return SegmentFrame(person, sample, round(1000.0 * sample / HZ), positions, quats)


def assert_same(frame: SegmentFrame, expected: SegmentFrame, tolerance: float = 1e-6) -> None:
    """Compares frames; q and -q are one orientation."""
    assert frame[:3] == expected[:3]
    np.testing.assert_allclose(frame.positions, expected.positions, atol=tolerance)
    cosines = np.abs(np.einsum("ij,ij->i", frame.quats_xyzw, expected.quats_xyzw))
    np.testing.assert_allclose(cosines, 1.0, atol=tolerance)


class Sender:
    """Sends datagrams to a port of this computer."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))

    def send(self, *datagrams: bytes) -> None:
        for data in datagrams:
            self._socket.send(data)

    def close(self) -> None:
        self._socket.close()


def broken_datagram(generator: random.Random, data: bytearray) -> bytes:
    """Returns garbage, or a datagram that was cut, made longer, or has other numbers or bytes."""
    what = generator.randrange(6)
    if what == 0:
        return generator.randbytes(generator.randrange(1500))
    if what == 1:
        return bytes(data[: generator.randrange(len(data))])
    if what == 2:
        return bytes(data) + generator.randbytes(generator.randrange(1, 100))
    if what == 3:
        at = generator.randrange(len(data) // 4) * 4
        data[at : at + 4] = struct.pack(">f", generator.choice([float("nan"), float("inf"), 3e38, -1e30, 1e-45, 0.0]))
        return bytes(data)
    for _ in range(generator.randrange(1, 6)):
        at = generator.randrange(24 if what == 4 else len(data))
        data[at] = generator.randrange(256)
    return bytes(data)
