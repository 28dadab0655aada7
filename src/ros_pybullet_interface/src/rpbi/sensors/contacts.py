"""Where bodies touch each other, and what they feel there."""

import math
from collections.abc import Mapping
from typing import Any

from custom_ros_tools.errors import PhysicsError
from rpbi.bodies.body import Body
from rpbi.engine.client import Client
from rpbi.geometry import scaled
from rpbi.samples import ContactPoint, ContactsSample

from .sensor import SensedWorld, Sensor


class ContactReader:
    """Contacts of the last tick, by body."""

    def __init__(self, pb: Client, bodies: Mapping[str, Body]) -> None:
        self._pb, self._bodies = pb, bodies
        self._touches: dict[int, list[Any]] | None = None
        """PyBullet's contact points by body id, as either end; None if it has to be asked."""
        self._by_id: dict[int, Body] = {}
        self._factor = 1.0

    def outdate(self) -> None:
        """Has PyBullet asked again: the world has moved on or has other bodies."""
        self._touches = None

    def of(self, body: Body) -> tuple[ContactPoint, ...]:
        """Returns where a body touches others or, with one of its links, another of its own."""
        if self._touches is None:
            self._touches = self._ask()
        return tuple(self._point(body, touch) for touch in self._touches.get(body.body_id, ()))

    def _ask(self) -> dict[int, list[Any]]:
        self._by_id = {body.body_id: body for body in self._bodies.values()}
        # PyBullet divides the impulse of the last sub-step by the whole time step.
        self._factor = max(1, self._pb.sub_steps)
        touches: dict[int, list[Any]] = {}
        # Asked for one body, PyBullet turns normals towards it but not friction; asked for all, it turns nothing.
        for touch in self._pb.getContactPoints():
            if touch[8] > 0.0 and touch[9] == 0.0:
                continue  # near, but not touching
            for body_id in {touch[1], touch[2]}:
                touches.setdefault(body_id, []).append(touch)
        return touches

    def _point(self, body: Body, touch: Any) -> ContactPoint:
        """Returns a contact as one of its bodies sees it; PyBullet tells what the second one does to the first."""
        is_first = touch[1] == body.body_id
        sign = 1.0 if is_first else -1.0
        other = self._by_id[touch[2] if is_first else touch[1]]
        own_link, other_link = (touch[3], touch[4]) if is_first else (touch[4], touch[3])
        return ContactPoint(
            body.link_name(own_link),
            other.name,
            other.link_name(other_link),
            touch[5] if is_first else touch[6],
            scaled(sign, touch[7]),
            -touch[8],
            self._factor * touch[9],
            (scaled(sign, touch[11]), scaled(sign, touch[13])),
            (self._factor * touch[10], self._factor * touch[12]),
        )


class ContactsSensor(Sensor):
    """All contact points of a body in the last tick."""

    sample_type = ContactsSample

    def __init__(self, body: Body, hz: float) -> None:
        super().__init__(body.name, hz)
        self._body = body
        self._reader: ContactReader | None = None

    def enter(self, world: SensedWorld) -> None:
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
