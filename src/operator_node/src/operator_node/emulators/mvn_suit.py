"""`mvn_emulator.py`: streams the motion of people who walk and reach, in the format of MVN's network streamer."""

import argparse
import random
import struct
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from custom_ros_tools.transforms import Array
from operator_node.mvn.orientations import inverse, multiply
from operator_node.mvn.player import send, sender_arguments, without_ros_arguments
from operator_node.mvn.segments import BONES, SEGMENTS

from .arm_held_out import ArmHeldOut
from .walking_person import WalkingPerson

KINDS = (1, 2, 12, 13, 20, 21, 22, 24, 25)
"""Message types that the emulator can send."""
NOISE_RAD = 2e-4
"""Standard deviation of the noise of orientations [rad]."""
INFO_PERIOD = 60
"""Period of the message types 12 and 13, in samples."""
SPACING_M = 1.2
_CM = 100.0


class Suit:
    """Creates the datagrams of one person, byte for byte as the protocol defines them.

    Args:
        person: Number of the person, from 0.
        moves: Motion of the person over time.
        kinds: Message types to send, from `KINDS`.
        items: Largest number of items per datagram. With fewer than 23 items, a frame needs several datagrams.
        noise_rad: Standard deviation of the noise of orientations [rad].
        hz: Sample rate, for the velocities and accelerations of type 21 [Hz].
        seed: Seed of the noise.
    """

    def __init__(
        self,
        person: int,
        moves: WalkingPerson | ArmHeldOut,
        kinds: Sequence[int] = (2,),
        items: int = 255,
        noise_rad: float = NOISE_RAD,
        hz: float = 240.0,
        seed: int = 0,
    ) -> None:
        self.person, self._moves, self._kinds, self._items, self._hz = person, moves, tuple(kinds), items, hz
        self._noise_rad, self._random = noise_rad, np.random.default_rng((seed, person))
        self._name = f"Person{person}"

    def datagrams(self, sample: int, time_s: float) -> list[bytes]:
        """Returns all datagrams of one sample.

        Args:
            sample: Number of the sample.
            time_s: Time of the sample [s].
        """
        positions, quats = self.pose(time_s)
        return [datagram for kind in self._kinds for datagram in self._of_kind(kind, sample, time_s, positions, quats)]

    def frame(self, sample: int, time_s: float, positions: Array, quats: Array) -> list[bytes]:
        """Returns the datagrams of type 02 for given origins (23 x 3) [m] and orientations (23 x 4), x, y, z, w."""
        return self._split(2, sample, time_s, self._numbered(positions, quats[:, [3, 0, 1, 2]]))

    def pose(self, time_s: float) -> tuple[Array, Array]:
        """Returns origins (23 x 3) [m] and noisy orientations (23 x 4), x, y, z, w, of the segments at a time [s]."""
        positions, quats = self._moves.pose(time_s)
        if self._noise_rad:
            noise = Rotation.from_rotvec(self._random.normal(0.0, self._noise_rad, (len(SEGMENTS), 3)))
            quats = multiply(quats, noise.as_quat())
        return positions, quats

    def _of_kind(self, kind: int, sample: int, time_s: float, positions: Array, quats: Array) -> list[bytes]:
        if kind in (12, 13) and sample % INFO_PERIOD:
            return []
        if kind == 1:
            y_up = quats[:, [1, 2, 0, 3]]
            euler = Rotation.from_quat(y_up).as_euler("xyz", degrees=True)
            return self._split(kind, sample, time_s, self._numbered(_CM * positions[:, [1, 2, 0]], euler))
        if kind == 2:
            return self.frame(sample, time_s, positions, quats)
        if kind == 12:
            text = f"name: {self._name}\nxmid: emulator\ncolor: 3070B0\n".encode()
            return [self._datagram(kind, sample, time_s, 0x80, 1, text)]
        if kind == 13:
            return [self._datagram(kind, sample, time_s, 0x80, len(SEGMENTS), self._scale())]
        if kind == 20:
            relative = multiply(inverse(quats[BONES[:, 0]]), quats[BONES[:, 1]])
            angles = Rotation.from_quat(relative).as_euler("xyz", degrees=True)
            items = [
                struct.pack(">2i3f", 256 * (parent + 1), 256 * (child + 1), *angle)
                for (parent, child), angle in zip(BONES, angles)
            ]
            return self._split(kind, sample, time_s, items)
        if kind == 21:
            before, after = (self._moves.pose(time_s + step / self._hz)[0] for step in (-1, 1))
            velocity = (after - before) * self._hz / 2.0
            acceleration = (after - 2.0 * positions + before) * self._hz**2
            return self._split(kind, sample, time_s, self._numbered(positions, velocity, acceleration))
        if kind == 22:
            still = np.zeros((len(SEGMENTS), 6))
            return self._split(kind, sample, time_s, self._numbered(quats[:, [3, 0, 1, 2]], still))
        if kind == 24:
            middle = struct.pack(">3f", *(0.5 * (positions[0] + positions[3])))
            return [self._datagram(kind, sample, time_s, 0x80, 1, middle)]
        seconds = time_s % 60.0
        minutes = int(time_s // 60)
        text = f"{minutes // 60 % 24:02}:{minutes % 60:02}:{seconds:06.3f}".encode()
        return [self._datagram(kind, sample, time_s, 0x80, 1, struct.pack(">i", len(text)) + text)]

    def _numbered(self, *columns: Array) -> list[bytes]:
        rows = np.concatenate(columns, axis=1)
        return [struct.pack(f">i{rows.shape[1]}f", number, *row) for number, row in enumerate(rows, 1)]

    def _split(self, kind: int, sample: int, time_s: float, items: list[bytes]) -> list[bytes]:
        parts = [items[begin : begin + self._items] for begin in range(0, len(items), self._items)]
        last = len(parts) - 1
        return [
            self._datagram(kind, sample, time_s, index | (0x80 if index == last else 0), len(part), b"".join(part))
            for index, part in enumerate(parts)
        ]

    def _datagram(self, kind: int, sample: int, time_s: float, counter: int, items: int, payload: bytes) -> bytes:
        head = b"MXTP%02d" % kind + struct.pack(">IBBI", sample % 2**32, counter, items, round(1000.0 * time_s))
        return head + struct.pack(">BBBBHH", self.person, len(SEGMENTS), 0, 0, 0, len(payload)) + payload

    def _scale(self) -> bytes:
        segments = [
            struct.pack(">i", len(name)) + name.encode() + struct.pack(">3f", *origin)
            for name, origin in zip(SEGMENTS, self._moves.t_pose)
        ]
        return struct.pack(">I", len(segments)) + b"".join(segments) + struct.pack(">I", 0)


class Sent(NamedTuple):
    """A datagram that is sent, and its fault: `duplicate`, `truncated`, or empty without a fault."""

    data: bytes
    fault: str = ""


class BadNetwork:
    """Emulates network faults: drops, repeats, truncates and reorders datagrams at random.

    Args:
        lost: Probability that a datagram is dropped.
        duplicate: Probability that a datagram is sent twice.
        truncated: Probability that a datagram is cut off.
        reordered: Probability that a datagram is sent after the next datagram.
        seed: Seed of the random numbers.

    Attributes:
        done: Number of datagrams, keyed by fault; the key `sent` counts datagrams without a fault.
    """

    def __init__(
        self, lost: float = 0.0, duplicate: float = 0.0, truncated: float = 0.0, reordered: float = 0.0, seed: int = 0
    ) -> None:
        self.done: Counter[str] = Counter()
        self._chances = {"lost": lost, "duplicate": duplicate, "truncated": truncated, "reordered": reordered}
        self._random = random.Random(seed)
        self._held: Sent | None = None

    def transmit(self, datagrams: Iterable[bytes]) -> Iterator[Sent]:
        """Yields the datagrams that the faulty network delivers in place of the given datagrams."""
        for data in datagrams:
            number, fault = self._random.random(), ""
            for name, chance in self._chances.items():
                if 0.0 <= number < chance:
                    fault = name
                number -= chance
            self.done[fault or "sent"] += 1
            if fault == "lost":
                continue
            if fault == "reordered" and self._held is None:
                self._held = Sent(data)
                continue
            if fault == "truncated":
                yield Sent(data[: self._random.randrange(len(data))], fault)
            else:
                yield Sent(data)
            if fault == "duplicate":
                yield Sent(data, fault)
            if self._held is not None:
                yield self._held
                self._held = None


def stream(suits: Sequence[Suit], hz: float, first_sample: int = 0) -> Iterator[tuple[float, list[bytes]]]:
    """Yields, for each sample, the time [s] and the datagrams of all suits. Never ends."""
    number = 0
    while True:
        time_s = number / hz
        yield time_s, [data for suit in suits for data in suit.datagrams(first_sample + number, time_s)]
        number += 1


def main() -> int:
    """Runs the command until Ctrl-C or the end of `--seconds`, and returns its exit code."""
    parser = sender_arguments("mvn_emulator.py", __doc__)
    parser.add_argument("--hz", type=float, default=60.0, help="samples a second, 1 to 240; by default 60")
    parser.add_argument("--people", type=int, default=1, help="number of people, 1 to 8")
    parser.add_argument("--height", type=float, default=1.75, help="height of the first one [m], 1 to 2.5")
    parser.add_argument("--speed", type=float, default=0.4, help="walking speed [heights/s], 0 to 0.6; 0 stands")
    parser.add_argument("--arm-held-out", action="store_true", help="they stand and hold out the right arm instead")
    parser.add_argument("--no-reach", action="store_true", help="arms do not reach")
    parser.add_argument("--t-pose", type=float, default=3.0, metavar="S", help="time in a T-pose at the start [s]")
    parser.add_argument(
        "--seconds", type=float, default=float("inf"), help="length of the stream [s]; by default forever"
    )
    parser.add_argument("--kinds", type=int, nargs="+", default=[2], choices=KINDS, metavar="N", help=f"types: {KINDS}")
    parser.add_argument(
        "--items", type=int, default=255, help="largest number of items per datagram; 23 or more is a whole frame"
    )
    for fault in ("lost", "duplicate", "truncated", "reordered"):
        parser.add_argument(
            f"--{fault}", type=float, default=0.0, metavar="P", help="share of the datagrams, 0 to 0.25"
        )
    parser.add_argument("--seed", type=int, default=0, help="seed of noise and faults")
    options = parser.parse_args(without_ros_arguments(sys.argv[1:]))
    faults = {name: getattr(options, name) for name in ("lost", "duplicate", "truncated", "reordered")}
    limits = {"hz": (1, 240), "people": (1, 8), "height": (1, 2.5), "speed": (0, 0.6), "t_pose": (0, 3600)}
    limits |= {"items": (1, 255), "port": (1, 65535), **dict.fromkeys(faults, (0, 0.25))}
    for name, (low, high) in limits.items():
        if not low <= getattr(options, name) <= high:
            parser.error(f"--{name.replace('_', '-')}: expected {low:g} to {high:g}, got {getattr(options, name):g}")
    suits = [
        Suit(
            person,
            _person(options, person),
            options.kinds,
            options.items,
            hz=options.hz,
            seed=options.seed,
        )
        for person in range(options.people)
    ]
    network = BadNetwork(**faults, seed=options.seed)
    timed = (
        (time_s, sent.data)
        for time_s, datagrams in _until(options.seconds, stream(suits, options.hz))
        for sent in network.transmit(datagrams)
    )
    where = f"{options.host}:{options.port}"
    print(f"streaming {options.people} of {options.height:g} m at {options.hz:g} Hz to {where}", flush=True)
    try:
        send(timed, options.host, options.port)
    except OSError as error:
        print(f"mvn_emulator: cannot send to {where}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        pass
    done = ", ".join(f"{count} {what}" for what, count in sorted(network.done.items()))
    print(f"datagrams: {done or 'none'}", flush=True)
    return 0


def _person(options: argparse.Namespace, number: int) -> WalkingPerson | ArmHeldOut:
    """Creates person `number`. Each person stands beside the previous person, and is a little smaller."""
    height_m, start = options.height * (1.0 - 0.03 * number), (0.0, -SPACING_M * number)
    if options.arm_held_out:
        return ArmHeldOut(height_m, options.seed, start, options.t_pose)
    return WalkingPerson(height_m, options.speed, t_pose_s=options.t_pose, start=start, reach=not options.no_reach)


def _until(seconds: float, samples: Iterator[tuple[float, list[bytes]]]) -> Iterator[tuple[float, list[bytes]]]:
    for time_s, datagrams in samples:
        if time_s >= seconds:
            return
        yield time_s, datagrams
