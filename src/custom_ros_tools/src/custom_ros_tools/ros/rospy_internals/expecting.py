"""Uses private parts of rospy, and logs a warning if they are missing or different."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import rospy

T = TypeVar("T")


def expecting(expected: str, loss: str, use: Callable[[], T]) -> T | None:
    """Calls a function that uses private parts of rospy. If it raises an error, logs a warning and returns None.

    While rospy shuts down, the warning is not logged, since errors are normal during the shutdown.

    Args:
        expected: Description of the expected parts, for the warning.
        loss: Description of the consequence if these parts are missing, for the warning.
        use: The function.

    Returns:
        Result of the function; None after an error.
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
