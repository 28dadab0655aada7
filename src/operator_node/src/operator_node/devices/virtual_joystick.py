"""Creates a virtual gamepad in this process, which SDL treats like a real gamepad."""

import ctypes
from collections.abc import Sequence

from operator_node.device import DeviceError
from operator_node.devices.sdl import pygame_with_joysticks

GAMEPAD = 1
"""SDL's number for joysticks of the type gamepad."""
AXES, BUTTONS, HATS = 6, 11, 1
FULL = 32767
HAT_UP, HAT_RIGHT, HAT_DOWN, HAT_LEFT = 1, 2, 4, 8
_Rumble = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_uint16, ctypes.c_uint16)


class _VirtualJoystickDesc(ctypes.Structure):
    """SDL's structure `SDL_VirtualJoystickDesc`, version 1."""

    _fields_ = [
        *((name, ctypes.c_uint16) for name in ("version", "type", "naxes", "nbuttons", "nhats")),
        *((name, ctypes.c_uint16) for name in ("vendor_id", "product_id", "padding")),
        ("button_mask", ctypes.c_uint32),
        ("axis_mask", ctypes.c_uint32),
        ("name", ctypes.c_char_p),
        ("userdata", ctypes.c_void_p),
        ("update", ctypes.c_void_p),
        ("set_player_index", ctypes.c_void_p),
        ("rumble", _Rumble),
        ("rumble_triggers", ctypes.c_void_p),
        ("set_led", ctypes.c_void_p),
        ("send_effect", ctypes.c_void_p),
    ]


class VirtualJoystick:
    """A virtual gamepad of SDL with two sticks, two triggers, a hat and buttons.

    The axes are, in this order: left stick (2), right stick (2), left trigger, right trigger and hat (2). Sticks and
    hat are positive to the left and up; a trigger is 1 at rest and -1 when it is fully pressed.

    Args:
        name: Name that SDL reports for the gamepad.

    Attributes:
        felt: Strengths of the strong and the weak motor in the last rumble, each from 0 to 1.

    Raises:
        DeviceError: If the installed SDL does not support virtual joysticks.
        MissingDependency: If pygame is not installed.
    """

    def __init__(self, name: str = "virtual gamepad") -> None:
        pygame_with_joysticks()
        self.felt = (0.0, 0.0)
        self._rumble = _Rumble(self._feel)
        self._sdl = sdl = ctypes.CDLL("libSDL2-2.0.so.0")  # the library that pygame uses
        sdl.SDL_GetError.restype = ctypes.c_char_p
        sdl.SDL_JoystickOpen.restype = ctypes.c_void_p
        description = _VirtualJoystickDesc(
            version=1, type=GAMEPAD, naxes=AXES, nbuttons=BUTTONS, nhats=HATS, name=name.encode(), rumble=self._rumble
        )
        index = sdl.SDL_JoystickAttachVirtualEx(ctypes.byref(description))
        if index < 0:
            raise DeviceError("virtual gamepad", f"SDL has none: {sdl.SDL_GetError().decode()}")
        self._id = sdl.SDL_JoystickGetDeviceInstanceID(index)
        self._joystick = ctypes.c_void_p(sdl.SDL_JoystickOpen(index))
        self.move([0.0] * 4 + [1.0] * 2 + [0.0] * 2)

    def move(self, axes: Sequence[float] = (), buttons: Sequence[int] = ()) -> None:
        """Sets the first axes and buttons to the given values. The remaining axes and buttons stay unchanged.

        Args:
            axes: Values in [-1, 1] of the first axes, in the order given in the class's docstring. The hat is set only
                if all 8 values are given.
            buttons: States of the first buttons, in SDL's order; 0 means released.
        """
        for index, value in enumerate(axes[:AXES]):
            raw = ctypes.c_int16(round(-FULL * max(-1.0, min(1.0, value))))
            self._sdl.SDL_JoystickSetVirtualAxis(self._joystick, index, raw)
        if len(axes) >= AXES + 2:
            x, y = axes[AXES : AXES + 2]
            hat = HAT_LEFT * (x > 0) + HAT_RIGHT * (x < 0) + HAT_UP * (y > 0) + HAT_DOWN * (y < 0)
            self._sdl.SDL_JoystickSetVirtualHat(self._joystick, 0, hat)
        for index, is_down in enumerate(buttons[:BUTTONS]):
            self._sdl.SDL_JoystickSetVirtualButton(self._joystick, index, int(bool(is_down)))
        self._sdl.SDL_JoystickUpdate()

    def unplug(self) -> None:
        """Removes the gamepad from SDL; may be called only once."""
        count = self._sdl.SDL_NumJoysticks()
        ids = [self._sdl.SDL_JoystickGetDeviceInstanceID(index) for index in range(count)]
        if self._id in ids:
            self._sdl.SDL_JoystickDetachVirtual(ids.index(self._id))

    def _feel(self, _: int, strong: int, weak: int) -> int:
        self.felt = (strong / 0xFFFF, weak / 0xFFFF)
        return 0
