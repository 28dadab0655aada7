"""Where a body touches others, and what it feels there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from custom_ros_tools.errors import PhysicsError

from ..contact_reader import ContactReader
from ..samples import ContactPoint, ContactsSample
from .sensor import Sensor

if TYPE_CHECKING:
    from ..bodies.body import Body
    from ..world import World


class ContactsSensor(Sensor):
    """All contact points of a body in the last tick.

    Args:
        body: The body.
        hz: Rate [Hz].
    """

    sample_type = ContactsSample

    def __init__(self, body: Body, hz: float) -> None:
        super().__init__(body.name, hz)
        self._body = body
        self._reader: ContactReader | None = None

    def enter(self, world: World) -> None:
        """Takes what the world knows of all contacts."""
        self._reader = world.contacts

    def read(self, tick: int) -> ContactsSample:
        """Reads the contacts; there are none before the first tick."""
        return ContactsSample(self.name, self.points(tick))

    def points(self, tick: int) -> tuple[ContactPoint, ...]:
        """Returns the contact points.

        Raises:
            PhysicsError: If a force or a place is not finite any more.
        """
        assert self._reader is not None  # the world sees to it
        points = self._reader.of(self._body)
        if not math.isfinite(sum(sum(point.force) + sum(point.position) + point.depth for point in points)):
            raise PhysicsError(f"{self.name}: contacts are not finite any more at tick {tick}")
        return points
