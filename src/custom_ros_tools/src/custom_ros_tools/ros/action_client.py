"""A client of actions that loses no answer."""

from __future__ import annotations

import threading
from typing import Any

import actionlib


class ActionClient(actionlib.SimpleActionClient):
    """actionlib's `SimpleActionClient`, with two differences.

    An answer that arrives before `send_goal` returns counts: actionlib drops it, so that `wait_for_result` may wait
    forever. Answers to goals that newer goals have replaced cause no error messages.

    Args:
        name: Name of the action.
        action_class: Class of the action's messages.
    """

    def __init__(self, name: str, action_class: type) -> None:
        self._sending = threading.RLock()
        super().__init__(name, action_class)

    def send_goal(self, *arguments: Any, **callbacks: Any) -> None:
        """Sends a goal; see `SimpleActionClient`."""
        with self._sending:
            super().send_goal(*arguments, **callbacks)

    def _handle_transition(self, goal_handle: Any) -> None:
        with self._sending:  # until `send_goal` has assigned the handle
            if goal_handle == self.gh:
                super()._handle_transition(goal_handle)
