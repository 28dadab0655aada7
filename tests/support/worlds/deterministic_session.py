"""Runs a world with contacts, moving targets and bodies that come and go; prints a hash of all samples."""

from __future__ import annotations

import hashlib
import math
import struct
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

from worlds import FLOOR, ball, box, iiwa, write_world

from rpbi.control.joint_command import JointCommand
from rpbi.world import World
from rpbi.world.loading import load_object

TICKS = 3000


def build() -> World:
    """Builds a heap of five bodies within reach of an arm."""
    with tempfile.TemporaryDirectory() as folder:
        path = write_world(
            Path(folder),
            collision=(FLOOR,),
            dynamic=tuple(
                (box if turn % 2 else ball)(
                    f"body{turn}", basePosition=[0.45, 0.02 * turn, 0.1 + 0.21 * turn], broadcast_hz=100
                )
                for turn in range(5)
            ),
            robots=(
                iiwa(
                    initial_joint_position={"lbr_iiwa_joint_2": 40.0, "lbr_iiwa_joint_4": -60.0},
                    joint_state_publisher_hz=1000,
                    broadcast_link_states=True,
                ),
            ),
        )
        return World.from_file(path)


def run(world: World, ticks: int = TICKS, visitors: bool = False) -> str:
    """Runs a world with targets that depend on the tick alone.

    Args:
        world: The world.
        ticks: For how long.
        visitors: Whether bodies come and go meanwhile.

    Returns:
        The hash of all samples, bit for bit.
    """
    digest = hashlib.sha256()
    for tick in range(ticks):
        if tick % 20 == 0:
            phase = 2.0 * math.pi * tick * 0.001
            target = JointCommand(
                ["lbr_iiwa_joint_1", "lbr_iiwa_joint_2"], [0.6 * math.sin(phase), 0.7 + 0.4 * math.sin(2 * phase)]
            )
            world.put("iiwa/target", target)
        if visitors and tick % 500 == 100:
            config = load_object("dynamic", ball("visitor", basePosition=[0.4, 0.1, 1.0]), "visitor.yaml")
            world.add("dynamic", config)
        if visitors and tick % 500 == 400:
            world.remove("visitor")
        for sample in world.step():
            digest.update(b"".join(struct.pack("<d", number) for number in _numbers(sample)))
    return digest.hexdigest()


def _numbers(sample: object) -> Iterable[float]:
    if isinstance(sample, float):
        yield sample
    elif isinstance(sample, tuple):
        for part in sample:
            yield from _numbers(part)


if __name__ == "__main__":
    print(run(build(), visitors="visitors" in sys.argv))
