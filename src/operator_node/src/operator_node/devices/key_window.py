"""A window that reads the keyboard."""

import math
import time
from collections.abc import Sequence
from tkinter import Event, Misc
from typing import NamedTuple

from .keys import CAPS_LOCK, KEY_CODES, NUM_LOCK, HeldKeys
from .window import INK, DeviceWindow

WIDTH_PX, HEIGHT_PX = 420, 220
LOCKS = {0x02: CAPS_LOCK, 0x10: NUM_LOCK}
"""Maps the bit of each lock in the state of a tkinter event to the bit of this lock in `keyboard/Key`."""
REPEAT_GAP_S = 0.003
"""Time to wait after a key goes up before it counts as released [s].

X reports each repetition of a held key as the key going up and, with the same time stamp, down again.
"""
NAMES = {
    "BackSpace": "BACKSPACE",
    "Tab": "TAB",
    "ISO_Left_Tab": "TAB",
    "Clear": "CLEAR",
    "Return": "RETURN",
    "Pause": "PAUSE",
    "Escape": "ESCAPE",
    "Delete": "DELETE",
    "KP_Decimal": "KP_PERIOD",
    "KP_Delete": "KP_PERIOD",
    "KP_Divide": "KP_DIVIDE",
    "KP_Multiply": "KP_MULTIPLY",
    "KP_Subtract": "KP_MINUS",
    "KP_Add": "KP_PLUS",
    "KP_Enter": "KP_ENTER",
    "KP_Equal": "KP_EQUALS",
    "KP_Insert": "KP0",
    "KP_End": "KP1",
    "KP_Down": "KP2",
    "KP_Next": "KP3",
    "KP_Left": "KP4",
    "KP_Begin": "KP5",
    "KP_Right": "KP6",
    "KP_Home": "KP7",
    "KP_Up": "KP8",
    "KP_Prior": "KP9",
    **{f"KP_{number}": f"KP{number}" for number in range(10)},
    "Up": "UP",
    "Down": "DOWN",
    "Right": "RIGHT",
    "Left": "LEFT",
    "Insert": "INSERT",
    "Home": "HOME",
    "End": "END",
    "Prior": "PAGEUP",
    "Next": "PAGEDOWN",
    **{f"F{number}": f"F{number}" for number in range(1, 16)},
    "Num_Lock": "NUMLOCK",
    "Caps_Lock": "CAPSLOCK",
    "Scroll_Lock": "SCROLLOCK",
    "Shift_R": "RSHIFT",
    "Shift_L": "LSHIFT",
    "Control_R": "RCTRL",
    "Control_L": "LCTRL",
    "Alt_R": "RALT",
    "Alt_L": "LALT",
    "Meta_R": "RMETA",
    "Meta_L": "LMETA",
    "Super_L": "LSUPER",
    "Super_R": "RSUPER",
    "Mode_switch": "MODE",
    "ISO_Level3_Shift": "MODE",
    "Multi_key": "COMPOSE",
    "Help": "HELP",
    "Print": "PRINT",
    "Sys_Req": "SYSREQ",
    "Break": "BREAK",
    "Menu": "MENU",
    "EuroSign": "EURO",
    "Undo": "UNDO",
}
"""Maps the names of X symbols to names of keys; all other symbols are characters, whose codes are used directly."""
CODES = frozenset(KEY_CODES.values())
NAME_OF_CODE = {code: name for name, code in KEY_CODES.items()}


def code_of(name: str, number: int) -> int:
    """Returns the key code for the X keysym with a name and a number; 0 if the keysym has no key code."""
    if name in NAMES:
        return KEY_CODES[NAMES[name]]
    code = ord(chr(number).lower()) if ord("A") <= number <= ord("Z") else number
    return code if code in CODES and number < 256 else 0


class PendingRelease(NamedTuple):
    """A key that X reported as released. The key is still held if X then reports a press with the same time stamp.

    Attributes:
        keycode: X's number for the position of the key on the keyboard.
        time: X's time stamp of the event [ms].
        locks: Sum of the bits of the locks, such as Caps Lock, that were on.
        due_s: Time of `time.monotonic` from which the key counts as released [s].
    """

    keycode: int
    time: int
    locks: int
    due_s: float


class KeyWindow:
    """A window that shows which keys are held. It records the keys that are pressed while the window has the focus.

    Args:
        keys: Object that is informed of each key that goes down or up.
        explanation: Lines of text that the window shows below the held keys.

    Raises:
        DeviceError: If there is no display.
    """

    def __init__(self, keys: HeldKeys, explanation: Sequence[str]) -> None:
        self._keys, self._explanation = keys, explanation
        self._codes: dict[int, int] = {}
        """Maps the X keycode of each held key to its code when it went down: the symbol of a key depends on modifiers.
        """
        self._pending: PendingRelease | None = None
        self._has_focus = False
        self._drawn: object = None
        self._window = window = DeviceWindow("keyboard", "keyboard", WIDTH_PX, HEIGHT_PX)
        window.bind("<KeyPress>", self._press)
        window.bind("<KeyRelease>", self._release)
        window.bind("<FocusIn>", lambda _: self._set_focus(True))
        window.bind("<FocusOut>", lambda _: self._set_focus(False))
        window.bind("<Configure>", lambda _: self._draw())
        window.focus()
        self._draw()

    def wait(self, timeout_s: float) -> None:
        """Processes queued events, or waits for the next event. Raises the errors of `DeviceWindow.wait`."""
        now_s = time.monotonic()
        due_s = self._pending.due_s if self._pending else math.inf
        self._window.wait(max(0.0, min(timeout_s, due_s - now_s)))
        if self._is_due():
            self._window.wait(0.0)  # on a busy machine this call may be late, and the awaited press already queued
            if self._is_due():
                self._apply_release()
        if self._drawn != (tuple(self._keys.codes), self._has_focus):
            self._draw()

    def close(self) -> None:
        """Closes the window."""
        self._window.close()

    def _is_due(self) -> bool:
        """Returns whether the pending release is due, so that the key counts as released."""
        return self._pending is not None and time.monotonic() >= self._pending.due_s

    def _press(self, event: "Event[Misc]") -> None:
        if self._pending and (event.keycode, event.time) == self._pending[:2]:
            self._pending = None  # a repetition
            return
        self._apply_release()
        code = code_of(event.keysym, event.keysym_num)
        self._codes[event.keycode] = code
        self._keys.press(code, _locks(event))

    def _release(self, event: "Event[Misc]") -> None:
        self._apply_release()
        if event.keycode in self._codes:
            self._pending = PendingRelease(event.keycode, event.time, _locks(event), time.monotonic() + REPEAT_GAP_S)

    def _apply_release(self) -> None:
        if self._pending is not None:
            self._keys.release(self._codes.pop(self._pending.keycode), self._pending.locks)
        self._pending = None

    def _set_focus(self, has_focus: bool) -> None:
        self._has_focus = has_focus
        if not has_focus:
            self._codes.clear()
            self._pending = None
            self._keys.release_all()

    def _draw(self) -> None:
        self._drawn = (tuple(self._keys.codes), self._has_focus)
        canvas = self._window.canvas
        canvas.delete("all")
        held = "  ".join(NAME_OF_CODE.get(code, "?") for code in self._keys.codes)
        if not self._has_focus:
            held = "click here to use the keyboard"
        canvas.create_text(16, 16, anchor="nw", text=held, fill="#1060c0", font=("TkFixedFont", 16))
        canvas.create_text(16, 60, anchor="nw", text="\n".join(self._explanation), fill=INK, font="TkFixedFont")


def _locks(event: "Event[Misc]") -> int:
    return sum(bit for mask, bit in LOCKS.items() if int(event.state) & mask)
