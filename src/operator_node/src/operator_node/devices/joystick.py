"""Input device joystick or gamepad, read through SDL."""

import contextlib
import math
import re
from collections import deque
from collections.abc import Iterable, Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from custom_ros_tools.schema import ConfigModel, Count, ListOf, Switch, Text, optional
from operator_node.device import Device, DeviceError, Reading

from .sdl import pygame_with_joysticks, triggers_of

RAW = 32768
"""Number by which pygame divides the raw value of an axis."""
FULL = 32767
UNPLUGGED = "it was unplugged"
RUMBLE_MS = 200
"""Duration of one rumble [ms]."""


def _numbered(path: str) -> str:
    if not re.search(r"\d+$", path):
        raise ValueError(f"expected a path that ends with a number, such as /dev/input/js0, got '{path}'")
    return path


class JoystickConfig(ConfigModel):
    """Selection of a joystick, and treatment of its axes and buttons.

    `dev`, `dev_name`, `deadzone` and `sticky_buttons` are named as in ROS's `joy_node`.
    """

    dev: Annotated[Text, AfterValidator(_numbered)] = Field(
        "/dev/input/js0", description="Path whose number selects the joystick; `/dev/input/js0` selects the first one."
    )
    dev_name: Text | None = optional(
        "Part of the joystick's name; the first joystick that matches is used instead of `dev`. By default, `dev` "
        "selects the joystick."
    )
    deadzone: float = Field(0.05, ge=0.0, lt=1.0, description="Fraction of an axis's range that counts as 0.")
    sticky_buttons: Switch = Field(
        False, description="Whether a button changes between 0 and 1 each time it is pressed."
    )
    triggers: ListOf[Count] | None = optional(
        "Indices of the axes that are 1 at rest, such as triggers. By default, the triggers of a gamepad that SDL "
        "knows."
    )
    virtual: Switch = Field(
        False, description="Whether a virtual gamepad is created, which messages on `joy/virtual` move."
    )


class Joystick(Device):
    """A joystick or gamepad that is read through SDL.

    Axes are positive to the left and up; a trigger is 1 at rest and -1 when it is fully pressed. As in `joy_node`, each
    hat adds two axes after the axes of the sticks.

    Attributes:
        is_virtual: Whether a virtual gamepad is created when the device is opened.
    """

    Config = JoystickConfig
    ros_topics = "operator_node.devices.device_topics:JoystickTopics"

    def __init__(self, config: JoystickConfig) -> None:
        self.axes: Sequence[str] = ()
        self.buttons: Sequence[str] = ()
        self.is_virtual = config.virtual
        self._virtual: Any = None
        self._config = config
        self._pygame: Any = None
        self._joystick: Any = None
        self._triggers: frozenset[int] = frozenset()
        self._pressed: list[int] = []
        self._events: deque[Any] = deque()
        self._is_new = False

    def open(self) -> None:
        self._pygame = pygame = pygame_with_joysticks()
        if self._config.virtual and self._virtual is None:
            from .virtual_joystick import VirtualJoystick

            self._virtual = VirtualJoystick()
        with contextlib.suppress(SystemError):  # see `_fetch`
            pygame.event.get()  # makes pygame detect new joysticks
        index = self._index()
        try:
            self._joystick = pygame.joystick.Joystick(index)
        except pygame.error as error:
            raise DeviceError(
                "joystick", f"it cannot be opened: {error}; check the permissions of /dev/input"
            ) from None
        given = self._config.triggers
        self._triggers = triggers_of(index) if given is None else frozenset(given)
        self._read_buttons()
        self._events.clear()
        self._update_names()
        self._is_new = True

    def read(self, timeout_s: float) -> Reading | None:
        if self._joystick is None:
            raise DeviceError("joystick", "it is not open")
        self._fetch(timeout_s)
        self._apply_events()
        if not self._is_new:
            return None
        self._is_new = False
        self._update_names()
        return Reading(tuple(self._positions()), tuple(self._pressed))

    def close(self) -> None:
        if self._joystick is not None:
            self._joystick.quit()
        if self._virtual is not None:
            self._virtual.unplug()
        self._joystick = self._virtual = None

    def at_rest(self) -> Reading:
        axes = tuple(float(index in self._triggers) for index in range(len(self.axes)))
        return Reading(axes, (0,) * len(self.buttons))

    def cue(self, force: Sequence[float]) -> None:
        strength = min(1.0, math.hypot(*force))
        self.rumble(strength, strength)

    def rumble(self, strong: float, weak: float) -> None:
        """Runs the strong and the weak motor for `RUMBLE_MS`, each with a strength from 0 to 1."""
        if self._joystick is not None:
            self._joystick.rumble(strong, weak, RUMBLE_MS)

    def move_virtual(self, axes: Sequence[float], buttons: Sequence[int]) -> None:
        """Sets axes and buttons of the virtual gamepad, if there is one; see `VirtualJoystick.move`."""
        if self._virtual is not None:
            self._virtual.move(axes, buttons)

    def _index(self) -> int:
        pygame, name = self._pygame, self._config.dev_name
        names = [pygame.joystick.Joystick(index).get_name() for index in range(pygame.joystick.get_count())]
        if name is not None:
            found = [index for index, each in enumerate(names) if name in each]
            if not found:
                raise DeviceError("joystick", f"no joystick is called '{name}'; there are {', '.join(names) or 'none'}")
            return found[0]
        number = int(re.findall(r"\d+$", self._config.dev)[0])
        if number >= len(names):
            raise DeviceError(
                "joystick", f"there is no joystick number {number}; there are {', '.join(names) or 'none'}"
            )
        return number

    def _fetch(self, timeout_s: float) -> None:
        """Queues the events of pygame. If no event is queued, waits for the next event.

        pygame 2.1 loses its queued events when a joystick that was never opened is unplugged. In this case, the state
        of all buttons is read again.
        """
        event = self._pygame.event
        try:
            if not self._events and timeout_s > 0.0:
                self._events.append(event.wait(max(1, math.ceil(1e3 * timeout_s))))
            self._events.extend(event.get())
        except SystemError:
            joysticks = self._pygame.joystick
            there = [joysticks.Joystick(index).get_instance_id() for index in range(joysticks.get_count())]
            if self._joystick.get_instance_id() not in there:
                raise DeviceError("joystick", UNPLUGGED) from None
            self._read_buttons()
            self._is_new = True

    def _read_buttons(self) -> None:
        joystick = self._joystick
        self._pressed = [joystick.get_button(number) for number in range(joystick.get_numbuttons())]

    def _apply_events(self) -> None:
        """Applies the queued events up to the next button event, so that even the shortest press yields a reading."""
        pygame, ours = self._pygame, self._joystick.get_instance_id()
        while self._events:
            event = self._events.popleft()
            if getattr(event, "instance_id", None) != ours:
                continue
            if event.type == pygame.JOYDEVICEREMOVED:
                raise DeviceError("joystick", UNPLUGGED)
            self._is_new = True
            if event.type in (pygame.JOYBUTTONDOWN, pygame.JOYBUTTONUP):
                self._press(event.button, event.type == pygame.JOYBUTTONDOWN)
                return

    def _press(self, button: int, is_down: bool) -> None:
        self._pressed += [0] * (button + 1 - len(self._pressed))
        if not self._config.sticky_buttons:
            self._pressed[button] = int(is_down)
        elif is_down:
            self._pressed[button] = 1 - self._pressed[button]

    def _positions(self) -> Iterable[float]:
        for index in range(self._joystick.get_numaxes()):
            yield axis_of(round(RAW * self._joystick.get_axis(index)), self._config.deadzone)
        for index in range(self._joystick.get_numhats()):
            right, up = self._joystick.get_hat(index)
            yield from (float(-right), float(up))

    def _update_names(self) -> None:
        sticks, hats = self._joystick.get_numaxes(), self._joystick.get_numhats()
        self.axes = [*map(str, range(sticks)), *(f"hat {hat} {axis}" for hat in range(hats) for axis in "xy")]
        self.buttons = [*map(str, range(len(self._pressed)))]


def axis_of(raw: int, deadzone: float) -> float:
    """Converts a raw value from -32768 to 32767 to the value of an axis in [-1, 1], with the opposite sign.

    Args:
        raw: Raw value of the axis.
        deadzone: Fraction of the range on either side within which the axis is 0. From the edge of the dead zone to
            the end of the range, the magnitude rises linearly from 0 to 1.
    """
    beyond = max(0.0, abs(raw) - FULL * deadzone)
    return -math.copysign(min(1.0, beyond / (FULL * (1.0 - deadzone))), raw) if beyond else 0.0
