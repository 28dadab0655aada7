"""Use of private parts of rospy, with a warning where they are missing or different."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import rospy

T = TypeVar("T")


def expecting(expected: str, loss: str, use: Callable[[], T]) -> T | None:
    """Returns the result of using private parts; None and a warning if they are not as expected.

    While rospy shuts down, differences are ignored: its parts are in another state then.
    """
    try:
        return use()
    except Exception as error:  # the node continues regardless of the error
        if not rospy.core.is_shutdown_requested():
            rospy.logwarn(
                "this rospy has different internals: expected %s, got %s: %s; %s",
                expected,
                type(error).__name__,
                error,
                loss,
            )
        return None
