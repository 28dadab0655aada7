"""Input device keyboard, whose keys act as axes and buttons."""

import sys
import time
from typing import Annotated

from pydantic import Field

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.schema import ConfigModel, ListOf, Positive, Seconds, Switch, Unit
from operator_node.device import Device, DeviceError, Reading

from .key_terminal import KeyTerminal
from .key_window import KeyWindow
from .keys import HeldKeys, KeyAxes, KeyEvent, KeyName, KeyPair

Milliseconds = Annotated[Positive, Unit("ms")]


class KeyboardConfig(ConfigModel):
    """Keys that act as axes and buttons, repetition of keys, and source of the keys (window or terminal)."""

    axes: ListOf[KeyPair] = Field(
        (), description="Two keys for each axis of `joy`: the key that makes the axis -1 and the key that makes it 1."
    )
    buttons: ListOf[KeyName] = Field((), description="One key for each button of `joy`.")
    allow_repeat: Switch = Field(False, description="Whether a held key repeatedly reports that it went down.")
    repeat_delay: Milliseconds = Field(500.0, description="Time until a held key begins to repeat.")
    repeat_interval: Milliseconds = Field(30.0, description="Time between two repetitions of a held key.")
    terminal: Switch = Field(
        False,
        description="Whether keys are read from the terminal instead of a window. A terminal does not report when a "
        "key goes up.",
    )
    terminal_hold_s: Seconds = Field(
        0.6, description="Time for which a key that was typed in the terminal counts as held."
    )


class Keyboard(Device):
    """A keyboard that is read through a separate window or through the terminal.

    The events in a reading are of type `KeyEvent`. All keys count as released while the window does not have the
    focus.

    Raises:
        ConfigError: If `terminal` is set and standard input is not a terminal.
    """

    Config = KeyboardConfig
    ros_topics = "operator_node.devices.device_topics:KeyboardTopics"

    def __init__(self, config: KeyboardConfig) -> None:
        if config.terminal and not sys.stdin.isatty():
            problem = "there is no terminal to read from: run the node in one, by rosrun rather than roslaunch"
            raise ConfigError([Problem("", "terminal", problem)])
        self.axes = tuple(f"{negative}/{positive}" for negative, positive in config.axes)
        self.buttons = tuple(config.buttons)
        self._config = config
        self._axes = KeyAxes(config.axes, config.buttons)
        self._source: KeyWindow | KeyTerminal | None = None
        self._is_new = False
        self._reset()

    def open(self) -> None:
        self._reset()
        if self._config.terminal:
            self._source = KeyTerminal(self._keys, self._config.terminal_hold_s)
        else:
            self._source = KeyWindow(self._keys, self._explanation())

    def read(self, timeout_s: float) -> Reading | None:
        if self._source is None:
            raise DeviceError("keyboard", "it is not open")
        if not (self._is_new and self._config.terminal):  # the first reading from a terminal is always at rest
            self._source.wait(max(0.0, min(timeout_s, self._keys.repeat_at_s - time.monotonic())))
        events = self._keys.drain_events()
        if not events and not self._is_new:
            return None
        self._is_new = False
        return self._axes.reading(self._keys.codes)._replace(events=events)

    def close(self) -> None:
        if self._source is not None:
            self._source.close()
        self._source = None
        self._reset()

    def at_rest(self) -> Reading:
        events = tuple(KeyEvent(code, 0, False) for code in [*self._keys.codes][::-1])
        return self._axes.reading(())._replace(events=events)

    def _reset(self) -> None:
        config = self._config
        self._keys = HeldKeys(config.allow_repeat, 1e-3 * config.repeat_delay, 1e-3 * config.repeat_interval)
        self._is_new = True

    def _explanation(self) -> list[str]:
        axes = [f"axis {index}:   - {minus:9} + {plus}" for index, (minus, plus) in enumerate(self._config.axes)]
        return [*axes, *(f"button {index}: {name}" for index, name in enumerate(self._config.buttons))]
