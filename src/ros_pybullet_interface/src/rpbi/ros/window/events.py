"""Keys and mouse of PyBullet's window as topics."""

from __future__ import annotations

import time

import rospy

from ros_pybullet_interface.msg import KeyboardEvent
from ros_pybullet_interface.msg import MouseEvent as MouseMessage
from rpbi.engine.clock import Clock
from rpbi.ros.headers import to_ros_time
from rpbi.window import DOWN, PRESSED, RELEASED, KeyEvent, MouseEvent, Window

KEYBOARD_TOPIC = "rpbi/keyboard"
MOUSE_TOPIC = "rpbi/mouse"
HELD_PERIOD_S = 1.0 / 60.0
"""How often a key that is held is told [s] of wall time; what happens to keys is told at once."""
KEY_WORDS = {DOWN: "key_is_down", PRESSED: "", RELEASED: "key_was_released"}
MOUSE_WORDS = {1: "mouse_move_event", 2: "mouse_button_event"}
NO_BUTTON = 255


class GuiEvents:
    """Publishes what happens to keys and mouse; what happened while nobody listened is not told later.

    Args:
        window: The window.
        clock: The world's clock.
        keyboard: Whether keys are published.
        mouse: Whether the mouse is.
    """

    def __init__(self, window: Window, clock: Clock, keyboard: bool, mouse: bool) -> None:
        self._window, self._clock = window, clock
        self._keys = rospy.Publisher(KEYBOARD_TOPIC, KeyboardEvent, queue_size=100) if keyboard else None
        self._mouse = rospy.Publisher(MOUSE_TOPIC, MouseMessage, queue_size=100) if mouse else None
        self._held_due_s = 0.0

    def poll(self) -> None:
        """Tells what has happened since the last time."""
        if self._keys is not None:
            self._poll_keys(self._keys)
        if self._mouse is not None:
            for event in self._window.mouse_events():
                self._mouse.publish(self._mouse_message(event))

    def _poll_keys(self, publisher: rospy.Publisher) -> None:
        events = list(self._window.key_events())
        if not events:
            return
        now_s = time.monotonic()
        is_due = now_s >= self._held_due_s
        if is_due:
            self._held_due_s = now_s + HELD_PERIOD_S
        for event in events:
            if is_due or event.state != DOWN:
                publisher.publish(self._key_message(event))

    def _key_message(self, event: KeyEvent) -> KeyboardEvent:
        message = KeyboardEvent(key=event.key, state=event.state, state_str=KEY_WORDS[event.state])
        message.header.stamp = to_ros_time(self._clock.stamp_ns)
        return message

    def _mouse_message(self, event: MouseEvent) -> MouseMessage:
        message = MouseMessage(
            event_type=event.kind,
            event_type_str=MOUSE_WORDS.get(event.kind, ""),
            mouse_pos_x=event.x,
            mouse_pos_y=event.y,
            button_index=event.button if event.button >= 0 else NO_BUTTON,
            button_state=event.state,
            button_state_str=event.state,
        )
        message.header.stamp = to_ros_time(self._clock.stamp_ns)
        return message
