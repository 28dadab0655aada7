"""What a search has found."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rpbi.kinematics.residual import Residual


class Found(NamedTuple):
    """A configuration.

    Attributes:
        q: The configuration.
        residuals: How far off each required task is.
        size: How far off the worst of them is, in tolerances.
        hard_size: The same of constraints alone.
    """

    q: np.ndarray
    residuals: dict[str, Residual]
    size: float
    hard_size: float

    @property
    def rank(self) -> tuple[float, float]:
        """What tells the better one: constraints first; all that are within tolerances are the same."""
        return max(self.hard_size, 1.0), max(self.size, 1.0)
