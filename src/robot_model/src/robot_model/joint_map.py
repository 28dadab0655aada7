"""The affine map from the driven joints to all joints, mimic joints included."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_model.urdf.elements import Mimic

Array = NDArray[np.float64]


class AffineMap(NamedTuple):
    """Positions of m joints as a function of n driven ones: `factors @ q + offsets`.

    Attributes:
        factors: m x n; velocities of the m joints are this times those of the n.
        offsets: m [rad or m].
    """

    factors: Array
    offsets: Array

    def __call__(self, q: Array) -> Array:
        """Returns m positions for n, or k x m for k x n [rad or m]."""
        positions: Array = q @ self.factors.T + self.offsets
        return positions

    @classmethod
    def of(
        cls,
        names: Sequence[str],
        driven: Sequence[str],
        mimics: Mapping[str, Mimic],
        still: Mapping[str, float] | None = None,
    ) -> AffineMap:
        """Returns the map to the joints of some names.

        Args:
            names: The m joints.
            driven: The n joints.
            mimics: For each mimic joint by name, the joint that it follows, which may itself mimic another.
            still: Positions of the joints that are neither driven nor follow a driven one [rad or m], 0 by default.
        """
        columns = {name: column for column, name in enumerate(driven)}
        factors, offsets = np.zeros((len(names), len(driven))), np.zeros(len(names))
        for row, name in enumerate(names):
            leader, multiplier, offset = followed(name, mimics) if name in mimics else Mimic(name, 1.0, 0.0)
            offsets[row] = offset
            if leader in columns:
                factors[row, columns[leader]] = multiplier
            else:
                offsets[row] += multiplier * (still or {}).get(leader, 0.0)
        return cls(factors, offsets)


def followed(name: str, mimics: Mapping[str, Mimic]) -> Mimic:
    """Returns the joint that a mimic joint finally follows, which follows no other.

    Raises:
        ValueError: If it follows itself; the message names the joint.
    """
    leader, multiplier, offset = mimics[name]
    passed: Collection[str] = {name}
    while leader in mimics and leader not in passed:
        passed = {*passed, leader}
        leader, more, shift = mimics[leader]
        multiplier, offset = multiplier * more, multiplier * shift + offset
    if leader in passed:
        raise ValueError(f"joint '{name}' follows '{mimics[name].joint}', which follows itself in the end")
    return Mimic(leader, multiplier, offset)
