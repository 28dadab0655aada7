"""The device `mvn`, moved by datagrams of a suit, held to the conformance suite."""

from __future__ import annotations

import random
from collections.abc import Sequence

from mvn_stream import T_POSE, Sender, broken_datagram, suit

from operator_node.conformance import DeviceConformance, Reader
from operator_node.device import Device
from operator_node.devices.mvn import AXES
from operator_node.mvn.segments import INDEX


class TestMvn(DeviceConformance):
    device_name = "mvn"
    options = {"port": 0, "timeout_s": 60.0}
    moves = AXES
    can_be_unplugged = False  # a suit that falls silent: test_mvn_receiver.py

    def make(self) -> Device:
        self.device, self.sample = super().make(), 0
        return self.device

    def settle(self, reader: Reader) -> None:
        self.move(AXES[0], 0.0)
        super().settle(reader)

    def move(self, axis: str, share: float) -> None:
        side, _, direction = axis.partition("_")
        positions, quats = T_POSE.pose(0.0)
        positions[INDEX[f"{side.title()}Hand"]]["xyz".index(direction)] += 0.5 * share
        self._send(suit().frame(self._next(), 0.0, positions, quats))

    def garbage(self, generator: random.Random) -> None:
        self._send([broken_datagram(generator, bytearray(suit().datagrams(self._next(), 0.0)[0]))])

    def _next(self) -> int:
        self.sample += 1
        return self.sample

    def _send(self, datagrams: Sequence[bytes]) -> None:
        sender = Sender(self.device.receiver.port)
        sender.send(*datagrams)
        sender.close()
