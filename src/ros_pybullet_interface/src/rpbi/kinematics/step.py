"""What a solver of inverse kinematics does."""

from __future__ import annotations

from typing import Protocol

import numpy as np


class Step(Protocol):
    """A method that brings a link nearer to its target."""

    def __call__(self, q: np.ndarray, frozen: np.ndarray, iterations: int) -> np.ndarray:
        """Returns m positions nearer to the target [rad or m]; limits are not considered.

        Args:
            q: m positions to start at.
            frozen: Which joints to leave where they are.
            iterations: Most iterations to make.
        """
