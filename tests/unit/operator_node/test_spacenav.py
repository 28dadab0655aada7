"""6-D mice, by the stand-in for spacenavd, which is held to what Debian's own client library says."""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
import random
import socket
import struct
import threading

import pytest
from tries import tries

from operator_node import conformance
from operator_node.conformance import PATIENCE_S, DeviceConformance, Reader
from operator_node.device import DeviceError
from operator_node.devices import DEVICES, spacenav
from operator_node.devices.spacenav import Spacenav, SpacenavConfig, socket_path
from operator_node.emulators.spacenavd import NAME, SpacenavDaemon

FULL = 512
LIBSPNAV = "libspnav.so.0"


class TestSpacenav(DeviceConformance):
    device_name = "spacenav"
    moves = ("x", "y", "z", "rx", "ry", "rz")
    presses = ("0", "1")
    protocol = 1

    @pytest.fixture(autouse=True)
    def _path(self, tmp_path):
        self.path = tmp_path / "spnav.sock"

    def make(self):
        self.options = {"socket": str(self.path), "static_count_threshold": 100}
        self.plug()
        return super().make()

    def plug(self):
        self.daemon = SpacenavDaemon(self.path, self.protocol)

    def unplug(self):
        self.daemon.close()

    def clean_up(self):
        self.daemon.close()

    def move(self, axis, share):
        at = {axis: round(share * FULL)}
        linear, angular = ([at.get(f"{turn}{name}", 0) for name in "xyz"] for turn in ("", "r"))
        self.daemon.move(*(value for x, y, z in (linear, angular) for value in (-y, z, x)))

    def press(self, button, is_down):
        self.daemon.press(int(button), is_down)

    def garbage(self, generator):
        self.daemon.send(generator.randbytes(generator.choice((1, 7, 31, 32, 32, 32, 64, 500))))


class TestSpacenavOfProtocol0(TestSpacenav):
    protocol = 0


class Reversed(TestSpacenav):
    """A person who moves it the other way: the suite has to notice."""

    def move(self, axis, share):
        super().move(axis, -share)


class Chattering(TestSpacenav):
    """A device that keeps reporting that it is at rest."""

    def make(self):
        device = super().make()
        device.read = lambda timeout_s: device.at_rest()
        return device


@pytest.mark.parametrize(
    "suite, test, arguments, complaint",
    [
        (Reversed(), "test_each_axis_moves_in_both_directions_and_back", (1.0,), "until axis 'x' is at 1"),
        (Chattering(), "test_device_at_rest_reports_nothing", (), "it keeps reporting readings at rest"),
    ],
)
def test_conformance_suite_finds_planted_faults(suite, test, arguments, complaint, tmp_path, monkeypatch):
    suite.path = tmp_path / "spnav.sock"
    reader = Reader("spacenav", suite.make())
    try:
        reader.until(lambda: len(reader.feed.free_axes) == 6, "it is open")
        monkeypatch.setattr(conformance, "PATIENCE_S", 0.2)
        with pytest.raises(AssertionError, match=complaint):
            getattr(suite, test)(reader, *arguments)
    finally:
        reader.feed.close()
        suite.clean_up()


@pytest.fixture
def daemon(tmp_path):
    with_device = SpacenavDaemon(tmp_path / "spnav.sock")
    yield with_device
    with_device.close()


def opened(daemon: SpacenavDaemon, **options) -> Reader:
    reader = Reader("spacenav", DEVICES.make("spacenav", {"socket": str(daemon.path), **options}))
    reader.until(lambda: bool(reader.readings), "it is open")
    return reader


def test_axes_are_those_of_spacenav_node(daemon):
    """x forward, y left, z up, where the device has x right, y up, z forward."""
    reader = opened(daemon, full_scale=100.0)
    reader.until(lambda: len(reader.feed.free_axes) == 6, "it is at rest")
    daemon.move(10, 20, 30, 40, 50, 60)
    reader.until(lambda: not reader.is_at_rest, "it moves")
    assert reader.last.axes == pytest.approx((0.3, -0.1, 0.2, 0.6, -0.4, 0.5))
    daemon.move(1000, -1000, 0)
    reader.until(lambda: reader.axis("y") == -1.0, "it is cut off")
    assert reader.axis("z") == -1.0
    reader.feed.close()


def test_only_small_values_are_zeroed_without_zero_when_static(daemon):
    reader = opened(daemon, zero_when_static=False)
    reader.until(lambda: len(reader.feed.free_axes) == 6, "it is at rest")
    daemon.move(0, 0, 300, 20, 0, 0)
    reader.until(lambda: reader.axis("ry") < 0.0, "it moves")
    reader.until(lambda: reader.axis("ry") == 0.0, "the turn comes to rest")
    assert reader.axis("x") > 0.5
    reader.feed.close()


def test_input_held_while_connecting_moves_nothing(daemon):
    """The device says only that it moves; until it has been at rest, that does not count."""
    reader = opened(daemon, static_count_threshold=2000)
    for _ in range(5):
        daemon.move(0, 0, 400)
        reader.feed.step(0.05)
    assert reader.is_at_rest and not reader.is_free("x")
    daemon.move(0, 0, 0)
    reader.until(lambda: reader.is_free("x"), "it was let go")
    daemon.move(0, 0, 400)
    reader.until(lambda: reader.axis("x") > 0.5, "it moves")
    reader.feed.close()


def test_without_a_device_the_daemon_is_not_enough(daemon):
    """Plugged in later, it is found; unplugged, it is missed."""
    daemon.unplug()
    device = Spacenav(SpacenavConfig(socket=str(daemon.path)))
    with pytest.raises(DeviceError, match="plugged in"):
        device.open()
    daemon.plug()
    device.open()
    daemon.unplug()
    with pytest.raises(DeviceError, match="unplugged"):
        for _ in tries("it is missed"):
            device.read(1.0)
    device.close()


def test_a_device_with_more_buttons_has_them_all(tmp_path):
    daemon = SpacenavDaemon(tmp_path / "spnav.sock", buttons=15)
    reader = opened(daemon)
    assert len(reader.last.buttons) == 15
    daemon.press(20)
    reader.until(lambda: len(reader.last.buttons) == 21, "the message has grown")
    daemon.press(20, False)
    daemon.press(20)
    reader.until(lambda: reader.last.buttons[-1:] == (1,), "it is pressed")
    reader.feed.close()
    daemon.close()


@pytest.mark.parametrize(
    "packet, reason",
    [
        ((0, 2**31 - 1, 0, 0, 0, 0, 0, 0), "a motion beyond 32767"),
        ((1, -1, 1, 0, 0, 0, 0, 0), "a button outside 0 to 63"),
        ((1, 64, 1, 0, 0, 0, 0, 0), "a button outside 0 to 63"),
        ((7, 0, 0, 0, 0, 0, 0, 0), "a packet of an unknown type"),
    ],
)
def test_invalid_packet_is_named_and_the_next_one_counts(daemon, packet, reason):
    reader = opened(daemon)
    reader.until(lambda: reader.is_free("x"), "it is at rest")
    daemon.send(struct.pack("=8i", *packet))
    reader.until(lambda: bool(reader.feed.refused), "it is refused")
    assert reader.feed.refused == {reason: 1} and reader.is_at_rest
    daemon.move(0, 0, FULL)
    reader.until(lambda: reader.axis("x") == 1.0, "it moves")
    reader.feed.close()


def test_another_protocol_is_hung_up_on_and_tried_again(daemon):
    reader = opened(daemon)
    daemon.send(random.Random(2).randbytes(3200))
    reader.until(lambda: reader.feed.problem is not None, "it hangs up")
    assert "protocol" in reader.feed.problem and sum(reader.feed.refused.values()) >= 8
    reader.until(lambda: reader.feed.problem is None, "it is open again")
    reader.feed.close()


def hostile_bytes(generator: random.Random) -> bytes:
    """Returns what a broken daemon may send: noise, or packets that are almost right."""
    if generator.random() < 0.3:
        return generator.randbytes(generator.randint(0, 400))
    packets = bytearray()
    for _ in range(generator.randint(1, 30)):
        size = generator.choice((1, 10, 1000, 2**31))
        kind = generator.choice((*range(9), spacenav.GET_BUTTONS, generator.randint(-(2**31), 2**31 - 1)))
        packets += struct.pack("=8i", kind, *(generator.randint(-size, size - 1) for _ in range(7)))
    return bytes(packets[: len(packets) - generator.choice((0, 0, 0, 5))])


REFUSALS = {
    "a motion beyond 32767",
    "a button outside 0 to 63",
    "a packet of an unknown type",
    "a motion beyond full_scale, which is cut off there",
}


def test_whatever_is_sent_readings_make_sense_and_refusals_have_reasons(tmp_path):
    """From the first word on; `SPACENAV_FUZZ` is how many connections to try."""
    generator = random.Random(3)
    path = str(tmp_path / "spnav.sock")
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(path)
    listener.listen()
    listener.settimeout(PATIENCE_S)

    def is_all_seen() -> bool:
        """Returns whether all reasons and a motion have come: how early depends on how fast they are read."""
        return reader.feed.refused.keys() == REFUSALS and any(any(reading.axes) for reading in reader.readings)

    def serve() -> None:
        while len(done) < connections or (not is_all_seen() and len(done) < 10 * connections):
            client, _ = listener.accept()
            client.settimeout(PATIENCE_S)
            with client, contextlib.suppress(OSError):  # the client has seen enough, or waited for too long
                client.recv(4)
                if generator.random() < 0.5:
                    client.sendall(struct.pack("=i", spacenav.PROTOCOL_TAG | 1))
                client.sendall(hostile_bytes(generator))
            done.append(1)

    connections, done = int(os.environ.get("SPACENAV_FUZZ", 300)), []
    reader = Reader("spacenav", DEVICES.make("spacenav", {"socket": path, "full_scale": 1.0}))
    server = threading.Thread(target=serve, daemon=True)
    server.start()
    while server.is_alive():
        reader.feed._open_at_s = -math.inf  # without the second between two tries
        reader.feed.step(0.01)  # in which the reader checks every reading
    reader.feed.close()
    listener.close()
    assert len(done) >= connections
    # Not `is_at_rest`: a failed attempt to open after the last reading may have revealed more buttons
    assert not any((*reader.last.axes, *reader.last.buttons))
    assert is_all_seen()


def test_socket_is_found_as_libspnav_finds_it(monkeypatch, tmp_path):
    settings = tmp_path / "spnavrc"
    monkeypatch.setattr(spacenav, "SETTINGS", str(settings))
    monkeypatch.delenv("SPNAV_SOCKET", raising=False)
    assert socket_path() == "/var/run/spnav.sock"
    settings.write_text("# socket = /no\nled = on\nsocket = /tmp/other.sock # here\n")
    assert socket_path() == "/tmp/other.sock"
    monkeypatch.setenv("SPNAV_SOCKET", "/tmp/first.sock")
    assert socket_path() == "/tmp/first.sock"


class SpnavEvent(ctypes.Union):
    """`spnav_event` of spnav.h: a type, then the motion or the button."""

    _fields_ = [("words", ctypes.c_int * 16), ("size", ctypes.c_byte * 128)]


def test_client_library_of_debian_understands_the_emulator(tmp_path):
    """Version, name, buttons, motions and presses; that it has 5 buttons, the library cannot guess."""
    path = tmp_path / "spnav.sock"
    daemon = SpacenavDaemon(path, buttons=5)
    spnav = ctypes.CDLL(LIBSPNAV)
    before = os.environ.get("SPNAV_SOCKET")
    os.environ["SPNAV_SOCKET"] = str(path)  # by which C finds it too
    try:
        assert spnav.spnav_open() == 0
    finally:
        os.environ.pop("SPNAV_SOCKET") if before is None else os.environ.update(SPNAV_SOCKET=before)
    try:
        event = SpnavEvent()
        assert spnav.spnav_protocol() == 1
        assert spnav.spnav_dev_buttons() == 5
        name = ctypes.create_string_buffer(100)
        spnav.spnav_dev_name(name, 100)
        assert name.value == NAME
        daemon.move(1, 2, 3, 4, 5, 6)
        assert spnav.spnav_wait_event(ctypes.byref(event)) == 1
        assert [*event.words[1:7]] == [1, 2, 3, 4, 5, 6]
        daemon.press(1)
        assert spnav.spnav_wait_event(ctypes.byref(event)) == 2
        assert [*event.words[1:3]] == [1, 1]
    finally:
        spnav.spnav_close()
        daemon.close()
