"""The affine map from positions of driven joints to positions of other joints, such as mimic joints."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_model.urdf.elements import Mimic

Array = NDArray[np.float64]


class AffineMap(NamedTuple):
    """Affine map from the positions q of n driven joints to the positions of m joints: `factors @ q + offsets`.

    Attributes:
        factors: Matrix m x n, which also maps velocities of the n joints to velocities of the m joints.
        offsets: Positions of the m joints for q = 0, shape (m,) [rad or m].
    """

    factors: Array
    offsets: Array

    def __call__(self, q: Array) -> Array:
        """Maps n driven positions to m positions, or k x n driven positions to k x m positions [rad or m]."""
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
        """Returns the map from driven joints to selected joints.

        Args:
            names: Names of the m selected joints.
            driven: Names of the n driven joints.
            mimics: Mimic relations, indexed by mimic joint name; a followed joint may itself be a mimic joint.
            still: Positions of joints that are not driven, indexed by joint name [rad or m]; joints without an entry
                are at 0.
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
    """Follows the chain of mimic joints that begins at a joint, and returns the joint's relation to the chain's end.

    Raises:
        ValueError: If the chain is a loop; the message names the joint.
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
