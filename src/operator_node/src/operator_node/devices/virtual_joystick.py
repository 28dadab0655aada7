"""A virtual gamepad in this process, which SDL treats as a real one."""

import ctypes
from collections.abc import Sequence

from operator_node.device import DeviceError
from operator_node.devices.sdl import pygame_with_joysticks

GAMEPAD = 1
"""SDL's number for this type of joystick."""
AXES, BUTTONS, HATS = 6, 11, 1
FULL = 32767
HAT_UP, HAT_RIGHT, HAT_DOWN, HAT_LEFT = 1, 2, 4, 8
_Rumble = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_uint16, ctypes.c_uint16)


class _VirtualJoystickDesc(ctypes.Structure):
    """SDL_VirtualJoystickDesc, version 1."""

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
    """A virtual gamepad of SDL: two sticks, two triggers, a hat and buttons, in SDL's order.

    Its axes are, as in its messages, left stick, right stick (left and up positive), left and right trigger (1 at
    rest), hat.

    Args:
        name: Its name.

    Attributes:
        felt: Last strengths of the strong and the weak motor, each from 0 to 1.

    Raises:
        DeviceError: If this SDL has no virtual joysticks.
        MissingDependency: If pygame is not installed.
    """

    def __init__(self, name: str = "virtual gamepad") -> None:
        pygame_with_joysticks()
        self.felt = (0.0, 0.0)
        self._rumble = _Rumble(self._feel)
        self._sdl = sdl = ctypes.CDLL("libSDL2-2.0.so.0")  # the one that pygame uses
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
        """Sets the given axes and buttons, in order; values as in its messages."""
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
        """Removes it; may be called once."""
        count = self._sdl.SDL_NumJoysticks()
        ids = [self._sdl.SDL_JoystickGetDeviceInstanceID(index) for index in range(count)]
        if self._id in ids:
            self._sdl.SDL_JoystickDetachVirtual(ids.index(self._id))

    def _feel(self, _: int, strong: int, weak: int) -> int:
        self.felt = (strong / 0xFFFF, weak / 0xFFFF)
        return 0
