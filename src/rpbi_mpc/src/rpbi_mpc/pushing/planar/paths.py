"""Paths on a table, which specify the slider's reference pose as a function of time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, ListOf, Positive, PositiveMetres, Unit

SPACING = 0.0005
"""Largest distance between successive stored points of a path [m]."""

Point = tuple[float, float]


class PathConfig(ConfigModel):
    """A path on the table.

    Attributes:
        shape: `line`, `arc` (to the left), `s` (an arc to the left and an arc to the right), `eight`, or `points`.
        size: Length of the line, radius of the arcs, or half the length of the eight [m].
        angle: Angle of each arc [rad]. Default: a quarter of a circle.
        points: Corners of the path `points` in the frame of the path's start [m]. Straight lines join the corners.
        start: x, y and yaw of the path's start [m, m, rad].
        speed: Speed along the path [m/s].
    """

    shape: Literal["line", "arc", "s", "eight", "points"] = Field(
        "s",
        description="Shape of the path: `arc` turns left, `s` is an arc to the left and an arc to the right, "
        "`points` is a polyline.",
    )
    size: PositiveMetres = Field(
        0.25, description="Length of the line, radius of the arcs, or half the length of the eight."
    )
    angle: Annotated[Positive, Unit("rad"), Field(le=6.3)] = Field(math.pi / 2, description="Angle of each arc.")
    points: ListOf[Annotated[tuple[float, float], Field(strict=False), Unit("m")]] = Field(
        (), description="Corners of the path `points`, in the frame of the path's start."
    )
    start: Annotated[tuple[float, float, float], Field(strict=False), Unit("m, m, rad")] = Field(
        (0.0, 0.0, 0.0), description="Pose of the path's start: x, y, yaw."
    )
    speed: Annotated[float, Field(gt=0.0, le=0.5), Unit("m/s")] = Field(
        0.05, description="Speed of the slider along the path."
    )


class PushPath:
    """A path of the slider with constant speed. The reference yaw is the direction of the path.

    Args:
        config: Shape, start and speed.

    Raises:
        ValueError: If all points of the path `points` are equal.
    """

    def __init__(self, config: PathConfig) -> None:
        self.speed = config.speed
        x, y, yaw = config.start
        cos, sin = math.cos(yaw), math.sin(yaw)
        local = _even(SHAPES[config.shape](config))
        self._points = local @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
        steps = np.diff(self._points, axis=0)
        self._distances = np.concatenate([[0.0], np.hypot(*steps.T).cumsum()])
        directions = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        directions += 2 * math.pi * round((yaw - directions[0]) / (2 * math.pi))
        self._yaws = np.concatenate([directions, directions[-1:]])

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return float(self._distances[-1])

    @property
    def duration_s(self) -> float:
        """Time from the start to the end of the path [s]."""
        return self.length / self.speed

    @property
    def points(self) -> np.ndarray:
        """Equidistant points of the path, shape (N, 2) [m]. Neighbouring points are at most `SPACING` apart."""
        return self._points

    def poses(self, times_s: Any) -> np.ndarray:
        """Returns the slider's reference poses x, y, yaw at given times, shape (N, 3) [m, m, rad].

        Args:
            times_s: Times since the start of the path, a number or shape (N,) [s]. Times outside the path are clipped.
        """
        along = np.clip(np.atleast_1d(np.asarray(times_s, dtype=float)) * self.speed, 0.0, self.length)
        columns = (self._points[:, 0], self._points[:, 1], self._yaws)
        return np.stack([np.interp(along, self._distances, column) for column in columns], axis=1)

    def distance(self, point: Any) -> float:
        """Returns the least distance of a point (x, y) from the path [m]."""
        return float(np.hypot(*(self._points - np.asarray(point, dtype=float)).T).min())


def _even(points: np.ndarray) -> np.ndarray:
    """Returns equidistant points along a polyline, at most `SPACING` apart, shape (N, 2) [m]."""
    distances = np.concatenate([[0.0], np.hypot(*np.diff(points, axis=0).T).cumsum()])
    if not distances[-1] > 0.0:
        raise ValueError(f"points: expected at least two different ones, got {len(points)}")
    even = np.linspace(0.0, distances[-1], max(2, math.ceil(distances[-1] / SPACING) + 1))
    return np.stack([np.interp(even, distances, column) for column in points.T], axis=1)


def _line(config: PathConfig) -> np.ndarray:
    return np.array([[0.0, 0.0], [config.size, 0.0]])


def _arc(config: PathConfig) -> np.ndarray:
    turned = np.linspace(0.0, config.angle, 2000)
    return config.size * np.stack([np.sin(turned), 1.0 - np.cos(turned)], axis=1)


def _s(config: PathConfig) -> np.ndarray:
    """Returns points of an arc, followed by the same arc rotated by 180 degrees about its end."""
    first = _arc(config)
    return np.concatenate([first, (2 * first[-1] - first)[-2::-1]])


def _eight(config: PathConfig) -> np.ndarray:
    """Returns points of a lemniscate of Bernoulli, which starts at its middle in the direction of x.

    The smallest radius of curvature is a third of `size`.
    """
    turned = np.linspace(-math.pi / 2, 3 * math.pi / 2, 4000)
    x, y = np.cos(turned), np.sin(turned) * np.cos(turned)
    return config.size * np.stack([x - y, x + y], axis=1) / (math.sqrt(2) * (1 + np.sin(turned) ** 2))[:, None]


def _points(config: PathConfig) -> np.ndarray:
    return np.array([(0.0, 0.0), *config.points])


SHAPES: dict[str, Callable[[PathConfig], np.ndarray]] = {
    "line": _line,
    "arc": _arc,
    "s": _s,
    "eight": _eight,
    "points": _points,
}
"""For each shape, a function that returns points of a path from the origin, shape (N, 2) [m]. Straight lines join the
points.
"""
