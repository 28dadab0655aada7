"""Where searches start: within limits."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from rpbi.joint_model import LIMIT_ROUNDING

from .limits import Limits

_log = logging.getLogger(__name__)


class StartLimits:
    """Brings starts into limits, and warns of each joint once: a stream asks the same a hundred times a second.

    Args:
        joint_names: The n joints.
        limits: Their limits.
    """

    def __init__(self, joint_names: Sequence[str], limits: Limits) -> None:
        self._joint_names = tuple(joint_names)
        self._limits = limits
        self._warned_of: set[str] = set()

    def bring_in(self, start: Sequence[float]) -> list[float]:
        """Returns n positions within limits [rad or m].

        Args:
            start: n positions [rad or m].
        """
        inside = self._limits.bring_in(start, start)[0]
        joints = zip(self._joint_names, start, inside)
        outside = {name: asked for name, asked, used in joints if abs(asked - used) > LIMIT_ROUNDING}
        if not outside.keys() <= self._warned_of:
            positions = ", ".join(f"'{name}' {asked:g}" for name, asked in outside.items())
            _log.warning("the start is outside limits and is brought in: %s", positions)
            self._warned_of |= outside.keys()
        return inside
