"""A haptic device that writes down what it is sent, and a program that has it as the haptic node does.

As a program: arguments are a file for the forces; it pushes with 2 N at 250 Hz and prints the id of the loop's process.
"""

from __future__ import annotations

import os
import struct
import sys
import time
from pathlib import Path
from typing import NamedTuple

from pydantic import Field

from operator_node.haptics.config import HapticNodeConfig
from operator_node.haptics.devices.scripted import ScriptedConfig
from operator_node.haptics.emulated import EmulatedDevice
from operator_node.haptics.link import Setup
from operator_node.haptics.loop_client import LoopClient
from robot_model.geometry import Vector

EXPIRY_S = 0.016
RECORD = struct.Struct("=2d")


class Sent(NamedTuple):
    """A force that a device was sent.

    Attributes:
        at_s: Time of the tick, by the monotonic clock [s].
        force_n: Along z [N].
    """

    at_s: float
    force_n: float


class WritingConfig(ScriptedConfig):
    """Where the hand goes, and the file."""

    file: str = Field(description="Where forces are written.")
    to: tuple[float, float, float] = Field((0.02, 0.0, 0.0), description="Where the hand goes [m].")


class WritingHand(EmulatedDevice):
    """A hand that goes somewhere and stays there."""

    Config = WritingConfig
    config: WritingConfig

    def __init__(self, config: WritingConfig) -> None:
        super().__init__(config)

    def open(self) -> None:
        super().open()
        self._file = os.open(self.config.file, os.O_WRONLY | os.O_CREAT | os.O_APPEND)

    def close(self) -> None:
        super().close()
        os.close(self._file)

    def goal(self, time_s: float) -> Vector:
        return self.config.to

    def send(self, force: Vector, expires_s: float) -> None:
        super().send(force, expires_s)
        os.write(self._file, RECORD.pack(expires_s - EXPIRY_S, force[2]))


def setup_of(file: Path, **options: object) -> Setup:
    """Returns what the loop is to do with the hand."""
    config = HapticNodeConfig.parse({"expiry_s": EXPIRY_S, "passivity": False, "max_target_speed": 0.2}, "test")
    return Setup(WritingHand, WritingConfig.parse({"file": str(file), **options}, "test"), config)


def forces_in(file: Path, newest: int = 0) -> list[Sent]:
    """Returns the newest forces that were sent so far, 0 for all of them."""
    if not file.exists():
        return []
    with open(file, "rb") as data:
        whole = file.stat().st_size // RECORD.size
        data.seek(max(whole - newest, 0) * RECORD.size if newest else 0)
        records = data.read()
    return [Sent(*record) for record in RECORD.iter_unpack(records[: len(records) // RECORD.size * RECORD.size])]


def main() -> None:
    # Under its own name, by which the other process finds the class
    from writing_hand import setup_of

    client = LoopClient(setup_of(Path(sys.argv[1])), lambda report: None)
    client.start()
    print(client.process_id, flush=True)
    while True:
        client.observe_wrench((0.0, 0.0, 2.0), 0.0)
        time.sleep(0.004)


if __name__ == "__main__":
    main()
