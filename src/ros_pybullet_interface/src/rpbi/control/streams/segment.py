"""Segments between two targets: lines and cubics, and their moving averages."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class StreamSegment(NamedTuple):
    """The motion of some joints from one target to the next: a cubic Hermite spline, or a line.

    Attributes:
        start: Time of its beginning [ticks].
        length: Duration [ticks].
        goal: Positions at its end by joint index [rad or m].
        way: Distances from its beginning by joint index [rad or m].
        slopes: Velocities at both ends by joint index [rad or m per tick], None if it is a line.
        is_beyond: Whether it goes beyond the last target because the next one is late.
    """

    start: float
    length: float
    goal: Mapping[int, float]
    way: Mapping[int, float]
    slopes: tuple[Mapping[int, float], Mapping[int, float]] | None = None
    is_beyond: bool = False

    @property
    def end(self) -> float:
        """Time of its goal [ticks]."""
        return self.start + self.length

    def cut(self, tick: float) -> StreamSegment:
        """Returns its part before a time; of length 0 if that is empty."""
        length = max(tick - self.start, 0.0)
        basis = _hermite(length / self.length)
        way = {index: self.covered(index, basis) for index in self.way}
        goal = {index: value - self.way[index] + way[index] for index, value in self.goal.items()}
        slopes = None if self.slopes is None else (self.slopes[0], self.velocity(tick))
        return self._replace(length=length, goal=goal, way=way, slopes=slopes)

    def covered(self, index: int, basis: tuple[float, float, float]) -> float:
        """Returns the displacement of a joint for the values, or averages, of the basis functions."""
        if self.slopes is None:
            return self.way[index] * (basis[0] + basis[1] + basis[2])
        first, last = self.slopes
        return self.way[index] * basis[0] + self.length * (first[index] * basis[1] + last[index] * basis[2])

    def basis(self, tick: float, window: float) -> tuple[float, float, float]:
        """Returns the basis functions at a time, averaged over the window before it [ticks]."""
        share = (tick - self.start) / self.length
        if window <= 0.0:
            return _hermite(share)
        width = window / self.length
        after, before = _hermite_integral(share), _hermite_integral(share - width)
        return (after[0] - before[0]) / width, (after[1] - before[1]) / width, (after[2] - before[2]) / width

    def velocity(self, tick: float) -> Mapping[int, float]:
        """Returns the velocities by joint index at a time [rad or m per tick], outside of it those at its ends."""
        if self.slopes is None:
            return {index: way / self.length for index, way in self.way.items()}
        u = min(max((tick - self.start) / self.length, 0.0), 1.0) if self.length else 0.0
        first, last = self.slopes
        ends = {i: (1.0 - u) * (1.0 - 3.0 * u) * first[i] + u * (3.0 * u - 2.0) * last[i] for i in self.way}
        between = 6.0 * u * (1.0 - u) / self.length if self.length else 0.0
        return {index: between * way + ends[index] for index, way in self.way.items()}

    def acceleration_at_end(self) -> Mapping[int, float]:
        """Returns the accelerations at its end by joint index [rad or m per tick squared]."""
        first, last = self.slopes or (self.velocity(self.end),) * 2
        return {
            index: (2.0 * first[index] + 4.0 * last[index] - 6.0 * way / self.length) / self.length
            for index, way in self.way.items()
        }


def _hermite(share: float) -> tuple[float, float, float]:
    """Returns the cubic Hermite basis of the way and of the slopes at both ends, constant before 0 and after 1."""
    u = min(max(share, 0.0), 1.0)
    rest = 1.0 - u
    return u * u * (3.0 - 2.0 * u), u * rest * rest, -u * u * rest


def _hermite_integral(share: float) -> tuple[float, float, float]:
    """Returns the integrals of the Hermite basis from 0."""
    u = min(max(share, 0.0), 1.0)
    square = u * u
    beyond = max(share - 1.0, 0.0)
    return (
        square * u * (1.0 - u / 2.0) + beyond,
        square * (0.5 - u * (2.0 / 3.0 - u / 4.0)),
        square * u * (u / 4.0 - 1.0 / 3.0),
    )


def agree(way: Mapping[int, float], length: float, first: Mapping[int, float], last: Mapping[int, float]) -> bool:
    """Returns whether velocities fit the displacement; many senders fill them with zeros."""
    return all(
        abs(distance - length * (first[index] + last[index]) / 2.0)
        <= length * max(abs(first[index]), abs(last[index])) / 2.0 + 1e-9
        for index, distance in way.items()
    )
