"""Contacts of a body, averaged over the ticks between two samples."""

from collections.abc import Iterable
from functools import partial, reduce
from math import hypot

from robot_model.geometry import Vector, cross, minus, plus, scaled
from rpbi.samples import ContactPoint, ContactsSample
from rpbi.sensors.sensor import SensedBody

from .contacts import ContactsSensor


class MeanContactsSensor(ContactsSensor):
    """Averages the contacts of a body over all ticks since the last sample, to one point for each pair of links."""

    keeps_state = True

    def __init__(self, body: SensedBody, hz: float) -> None:
        super().__init__(body, hz)
        self._ticks: list[ContactsSample] = []
        self._latest: ContactsSample | None = None

    def after_step(self, tick: int) -> None:
        """Stores the contacts of the tick, if the sensor is on and has subscribers."""
        if self.wanted and self.hz:
            self._ticks.append(super().read(tick))
        else:
            self._ticks.clear()

    def read(self, tick: int) -> ContactsSample:
        """Returns the averaged contacts; while the world is stopped, returns the last averages again."""
        if self._ticks:
            self._latest = ContactsSample(self.name, partial(_mean_points, self._ticks))
            self._ticks = []
        return self._latest or super().read(tick)


def _mean_points(samples: list[ContactsSample]) -> tuple[ContactPoint, ...]:
    """Returns an averaged contact point for each pair of links.

    A tick in which two links did not touch counts as 0 N.

    Args:
        samples: The contacts of each tick.
    """
    by_links: dict[tuple[str, ...], list[ContactPoint]] = {}
    for sample in samples:
        for point in sample.points:
            by_links.setdefault(point[:3], []).append(point)
    return tuple(_mean(points, len(samples)) for points in by_links.values())


def _mean(points: list[ContactPoint], ticks: int) -> ContactPoint:
    """Returns one contact point at the centre of pressure of contact points between two links, with the mean force.

    Args:
        points: The contact points of the two links in all ticks.
        ticks: Number of ticks, including ticks without contact.
    """
    pressed = sum(point.normal_force for point in points)
    weights = [point.normal_force / pressed if pressed else 1.0 / len(points) for point in points]
    pressure = _total(scaled(point.normal_force / ticks, point.normal) for point in points)
    friction = minus(_total(scaled(1.0 / ticks, point.force) for point in points), pressure)
    normal, along = _unit(pressure, points[-1].normal), _unit(friction, points[-1].friction_directions[0])
    return ContactPoint(
        *points[-1][:3],
        _total(map(scaled, weights, (point.position for point in points))),
        normal,
        sum(weight * point.depth for weight, point in zip(weights, points)),
        hypot(*pressure),
        (along, cross(normal, along)),
        (hypot(*friction), 0.0),
    )


def _total(vectors: Iterable[Vector]) -> Vector:
    return reduce(plus, vectors)


def _unit(vector: Vector, default: Vector) -> Vector:
    size = hypot(*vector)
    return scaled(1.0 / size, vector) if size else default
