"""Shapes that belong to a robot."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..shape import Core


class RobotShape(NamedTuple):
    """A shape at a link, or in the base.

    Attributes:
        core: The shape.
        link_id: Pinocchio's number of its link; None: it stands in the base.
        placement: Where it is in the link or base, a `pinocchio.SE3`.
    """

    core: Core
    link_id: int | None
    placement: Any
