"""The keyboard, by real key presses in its window and by a terminal."""

from __future__ import annotations

import os
import pty
import sys

import numpy as np
import pytest
from keyboard.msg import Key
from tries import tries

from custom_ros_tools.errors import ConfigError
from operator_node.conformance import DeviceConformance, Reader
from operator_node.devices import DEVICES
from operator_node.devices.key_terminal import codes_in
from operator_node.devices.key_window import code_of
from operator_node.devices.keys import KeyEvent

KEYS = {"LEFT": "Left", "RIGHT": "Right", "DOWN": "Down", "UP": "Up"}
"""Names that xdotool has for keys; those of characters are their own."""
AXES = [["LEFT", "RIGHT"], ["DOWN", "UP"], ["b", "f"]]


@pytest.fixture(autouse=True)
def display(screen, monkeypatch):
    """Windows of this process are on the virtual screen."""
    monkeypatch.setenv("DISPLAY", screen.environment["DISPLAY"])


class TestKeyboard(DeviceConformance):
    device_name = "keyboard"
    options = {"axes": AXES, "buttons": [1, "2", "SPACE"]}
    moves = ("LEFT/RIGHT", "DOWN/UP", "b/f")
    presses = ("1", "2")
    can_be_unplugged = False

    @pytest.fixture(autouse=True)
    def _screen(self, screen):
        self.screen = screen
        self.held = {}

    def clean_up(self):
        for key in [*self.held]:
            self._turn(key, False)

    def _turn(self, name, is_down):
        self.screen.run("xdotool", "keydown" if is_down else "keyup", KEYS.get(name, name))
        self.held.pop(name, None)
        if is_down:
            self.held[name] = True

    def move(self, axis, share):
        for key, is_down in zip(axis.split("/"), (share < 0, share > 0)):
            if is_down != (key in self.held):
                self._turn(key, is_down)

    def press(self, button, is_down):
        self._turn(button, is_down)


class KeyReader(Reader):
    """A reader that keeps what keys did."""

    @property
    def events(self) -> list[KeyEvent]:
        return [event for reading in self.readings for event in reading.events]


@pytest.fixture
def keyboard(screen):
    readers = []

    def start(**options):
        reader = KeyReader("keyboard", DEVICES.make("keyboard", options))
        readers.append(reader)
        reader.until(lambda: bool(reader.readings), "it is open")
        if not options.get("terminal"):
            reader.until(lambda: any(each.title == "keyboard" for each in screen.windows()), "its window is there")
            reader.until(lambda: reader.device._source._has_focus, "it has the keyboard")
        return reader

    yield start
    for reader in readers:
        reader.feed.close()
    screen.run("xdotool", "keyup", "a", "keyup", "Shift_L", "keyup", "F5")


def test_keys_have_the_codes_and_modifiers_of_the_message(screen, keyboard):
    reader = keyboard()
    screen.run("xdotool", "keydown", "Shift_L", "key", "a", "keyup", "Shift_L", "key", "F5", "key", "KP_Add")
    reader.until(lambda: len(reader.events) == 8, "all keys have come")
    shift = Key.MODIFIER_LSHIFT
    assert [(event.code, event.modifiers, event.is_down) for event in reader.events] == [
        (Key.KEY_LSHIFT, 0, True),
        (Key.KEY_a, shift, True),
        (Key.KEY_a, shift, False),
        (Key.KEY_LSHIFT, 0, False),
        *((code, 0, is_down) for code in (Key.KEY_F5, Key.KEY_KP_PLUS) for is_down in (True, False)),
    ]
    assert all(reading.axes == reading.buttons == () for reading in reader.readings)


def test_held_key_gives_one_press_and_one_release(screen, keyboard):
    """Though X, and this is checked by what a bare window gets, says that it goes up and down again and again."""
    reader = keyboard()
    raw = []
    reader.device._source._window._root.bind("<KeyRelease>", raw.append, add="+")
    screen.run("xdotool", "keydown", "a")
    reader.until(lambda: len(raw) >= 5, "X repeats it")
    assert reader.events == [KeyEvent(Key.KEY_a, 0, True)]
    screen.run("xdotool", "keyup", "a")
    reader.until(lambda: len(reader.events) > 1, "it goes up")
    assert reader.events[1:] == [KeyEvent(Key.KEY_a, 0, False)]


def test_repetitions_are_an_option_with_a_pace_of_its_own(screen, keyboard):
    reader = keyboard(allow_repeat=True, repeat_delay=20.0, repeat_interval=5.0)
    screen.run("xdotool", "keydown", "a")
    reader.until(lambda: len(reader.events) >= 6, "it repeats")
    assert {*reader.events} == {KeyEvent(Key.KEY_a, 0, True)}
    screen.run("xdotool", "keyup", "a")
    reader.until(lambda: not reader.events[-1].is_down, "it goes up")


def test_who_types_elsewhere_holds_nothing_here(screen, keyboard):
    reader = keyboard(axes=[["a", "b"]])
    screen.run("xdotool", "keydown", "b")
    reader.until(lambda: reader.last.axes == (1.0,), "it is held")
    other = DEVICES.make("mouse", {})
    other.open()
    for _ in tries("the other window is open"):
        other.read(0.01)
        if any(each.title == "mouse" for each in screen.windows()):
            break
    screen.run("xdotool", "search", "--name", "^mouse$", "windowfocus")
    reader.until(lambda: reader.last.axes == (0.0,), "it counts as let go")
    assert reader.events[-1] == KeyEvent(Key.KEY_b, 0, False)
    other.close()
    screen.run("xdotool", "keyup", "b")


def test_closing_releases_held_keys(screen, keyboard):
    reader = keyboard()
    screen.run("xdotool", "keydown", "a", "keydown", "F5")
    reader.until(lambda: len(reader.events) == 2, "they are held")
    reader.feed.close()
    assert [(event.code, event.is_down) for event in reader.events[2:]] == [
        (Key.KEY_F5, False),
        (Key.KEY_a, False),
    ]


def test_window_shows_held_keys(screen, keyboard):
    reader = keyboard(axes=AXES, buttons=["1"])
    (place,) = (each for each in screen.windows() if each.title == "keyboard")

    def shown():
        """Returns the parts for what is held, and for what there is."""
        picture = screen.grab(place)
        return picture[:50], picture[60:]

    reader.until(lambda: [np.ptp(part) > 0 for part in shown()] == [False, True], "it shows that nothing is held")
    _, before = shown()
    screen.run("xdotool", "keydown", "a")
    reader.until(lambda: len(reader.events) == 1, "it is held")
    reader.until(lambda: np.ptp(shown()[0]) > 0, "it shows what is held")
    assert (shown()[1] == before).all()


@pytest.fixture
def terminal(monkeypatch):
    """The end of a terminal into which one types; the other one is standard input."""
    ours, theirs = pty.openpty()
    with os.fdopen(theirs) as standard_input:
        monkeypatch.setattr(sys, "stdin", standard_input)
        yield ours
    os.close(ours)


def test_a_key_of_a_terminal_is_held_for_a_time(terminal, keyboard):
    reader = keyboard(terminal=True, terminal_hold_s=1e-6, axes=[["LEFT", "RIGHT"]], buttons=["a"])
    reader.until(lambda: bool(reader.feed.free_axes), "it is at rest")
    os.write(terminal, b"\x1b[Ca")
    reader.until(lambda: len(reader.events) == 4, "both are over")
    right, a = Key.KEY_RIGHT, Key.KEY_a
    assert [(event.code, event.is_down) for event in reader.events] == [
        (right, True),
        (a, True),
        (right, False),
        (a, False),
    ]
    assert any(reading.axes == (1.0,) and reading.buttons == (1,) for reading in reader.readings)
    assert reader.is_at_rest


def test_key_typed_right_after_opening_the_terminal_counts(terminal, keyboard):
    reader = keyboard(terminal=True, terminal_hold_s=60.0, axes=[["LEFT", "RIGHT"]])
    os.write(terminal, b"\x1b[C")
    reader.until(lambda: bool(reader.events), "it has come")
    assert reader.readings[-1].axes == (1.0,)
    assert not reader.feed.held


def test_a_terminal_that_is_none_is_refused_at_the_start(monkeypatch):
    with open(os.devnull) as nothing, monkeypatch.context() as patch:
        patch.setattr(sys, "stdin", nothing)
        with pytest.raises(ConfigError, match="terminal.*rosrun"):
            DEVICES.make("keyboard", {"terminal": True})


@pytest.mark.parametrize(
    "typed, names",
    [
        ("ab", "ab"),
        ("A ", ("a", "SPACE")),
        ("\x1b[A\x1bOB\x1b[5~\x1b", ("UP", "DOWN", "PAGEUP", "ESCAPE")),
        ("\x1bOP\x1b[24~\r\x7f", ("F1", "F12", "RETURN", "BACKSPACE")),
        ("\x00~\ufffd", ("UNKNOWN",) * 3),
    ],
)
def test_terminals_have_sequences_for_keys(typed, names):
    assert codes_in(typed) == [getattr(Key, f"KEY_{name}") for name in names]


@pytest.mark.parametrize(
    "symbol, number, name",
    [
        ("a", 97, "a"),
        ("A", 65, "a"),
        ("adiaeresis", 228, "WORLD_68"),
        ("KP_Up", 0xFF97, "KP8"),
        ("Prior", 0xFF55, "PAGEUP"),
        ("percent", 37, "UNKNOWN"),
        ("XF86AudioPlay", 0x1008FF14, "UNKNOWN"),
    ],
)
def test_symbols_of_x_have_codes(symbol, number, name):
    assert code_of(symbol, number) == getattr(Key, f"KEY_{name}")
