"""Where a link shall be."""

from __future__ import annotations

from typing import NamedTuple

from ..pose import Quaternion, Vector


class Target(NamedTuple):
    """Where a link shall be.

    Attributes:
        position: x, y, z in the base [m].
        quat_xyzw: Its orientation in the base, a unit quaternion; None: any.
    """

    position: Vector
    quat_xyzw: Quaternion | None
