"""Contact points between bodies, and their forces."""

from collections.abc import Iterable, Mapping
from functools import partial
from itertools import chain
from math import dist, isfinite
from typing import Any

from custom_ros_tools.errors import PhysicsError
from robot_model.geometry import scaled
from rpbi.engine.client import Client
from rpbi.samples import ContactPoint, ContactsSample
from rpbi.sensors.sensor import SensedBody, SensedWorld, Sensor

Touch = tuple[Any, ...]
"""A contact point as PyBullet's `getContactPoints` returns it."""


class ContactReader:
    """Reads all contacts of the last tick in one call of PyBullet, and groups them by body."""

    def __init__(self, pb: Client, bodies: Mapping[str, SensedBody]) -> None:
        self._pb, self._bodies = pb, bodies
        self._touches: dict[int, list[list[Touch]]] | None = None
        """Contact points by the ids of both of their bodies, grouped by pairs of links; None if PyBullet has to be
        asked."""
        self._by_id: dict[int, SensedBody] = {}
        self._factor = 1.0
        self._are_finite = True

    def invalidate(self) -> None:
        """Discards the stored contacts, after the world has advanced or bodies were added or removed."""
        self._touches = None

    def sample(self, body: SensedBody, tick: int) -> ContactsSample:
        """Returns the contacts of a body in the last tick, including contacts between the body's own links.

        Raises:
            PhysicsError: If a number in the contacts is no longer finite.
        """
        if self._touches is None:
            self._touches = self._ask()
        touches = self._touches.get(body.body_id, [])
        if not self._are_finite and not _finite(chain.from_iterable(touches)):
            raise PhysicsError(f"{body.name}: contacts are not finite any more at tick {tick}")
        return ContactsSample(body.name, partial(_points, body, touches, self._by_id, self._factor))

    def _ask(self) -> dict[int, list[list[Touch]]]:
        self._by_id = {body.body_id: body for body in self._bodies.values()}
        # PyBullet divides the impulse of the last sub-step by the whole time step.
        self._factor = max(1, self._pb.sub_steps)
        # With a body as argument, PyBullet would turn the normals towards it, but not the friction directions.
        all_touches = self._pb.getContactPoints()
        self._are_finite = _finite(all_touches)
        by_body: dict[int, list[list[Touch]]] = {}
        links: tuple[int, ...] = ()
        together: list[Touch] = []
        for touch in all_touches:
            if touch[8] > 0.0 and touch[9] == 0.0:
                continue  # near, but not touching
            if touch[1:5] != links:
                links, together = touch[1:5], []
                for body_id in {touch[1], touch[2]}:
                    by_body.setdefault(body_id, []).append(together)
            together.append(touch)
        return by_body


def _finite(touches: Iterable[Touch]) -> bool:
    """Returns whether all numbers of the contact points are finite.

    The function `dist` returns a finite number only if both of its vectors are finite.
    """
    sizes = [dist(t[5], t[6]) + dist(t[7], t[11]) + dist(t[7], t[13]) + t[8] + t[9] + t[10] + t[12] for t in touches]
    return isfinite(sum(sizes))


def _points(
    body: SensedBody, touches: list[list[Touch]], by_id: Mapping[int, SensedBody], factor: float
) -> tuple[ContactPoint, ...]:
    """Converts contacts to contact points with the forces that act on one body.

    PyBullet reports the forces that the second body of a contact exerts on the first body.

    Args:
        body: The body that the forces act on.
        touches: Contact points of the body, grouped by pairs of links.
        by_id: All bodies, indexed by PyBullet's id.
        factor: Factor by which the forces that PyBullet reports are multiplied.
    """
    points = []
    for together in touches:
        _, first, second, first_link, second_link, *_ = together[0]
        is_first = first == body.body_id
        sign, on_body = (1.0, 5) if is_first else (-1.0, 6)
        other, own_link, link = (second, first_link, second_link) if is_first else (first, second_link, first_link)
        names = body.link_name(own_link), by_id[other].name, by_id[other].link_name(link)
        points += [
            ContactPoint(
                *names,
                touch[on_body],
                scaled(sign, touch[7]),
                -touch[8],
                factor * touch[9],
                (scaled(sign, touch[11]), scaled(sign, touch[13])),
                (factor * touch[10], factor * touch[12]),
            )
            for touch in together
        ]
    return tuple(points)


class ContactsSensor(Sensor):
    """Measures all contact points of a body in the last tick."""

    sample_type = ContactsSample
    keeps_state = False
    ros_topic = "rpbi.ros.publishers.sample_topics:CONTACTS"

    def __init__(self, body: SensedBody, hz: float) -> None:
        super().__init__(body.name, hz)
        self._body = body
        self._reader: ContactReader | None = None

    def enter(self, world: SensedWorld) -> None:
        """Stores the world's contact reader."""
        self._reader = world.contacts

    def read(self, tick: int) -> ContactsSample:
        """Reads the contact points of the last tick; before the first tick, the sample is empty.

        Raises:
            PhysicsError: If a number in the contacts is no longer finite.
        """
        assert self._reader is not None  # ensured by the world
        return self._reader.sample(self._body, tick)
