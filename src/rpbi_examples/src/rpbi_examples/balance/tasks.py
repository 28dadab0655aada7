"""Tasks of a whole-body controller: accelerations that are wanted of parts of the robot, and the way of a hand."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_model.geometry import Pose
from rpbi.control.controllers.controller import Array

from .dynamics import FrameMotion, rotation_of, turn_between, turned

GRAVITY = 9.81
"""[m/s^2]."""
RATE = 6.0
"""Rate at which the rest of a way is covered [1/s]."""
TURN_SPEED = 1.5
"""Largest rotational speed [rad/s]."""
LEASH_M, LEASH_RAD = 0.05, 0.3
"""Largest lead of the target of the hand, in position and orientation."""


class AccelerationTask(NamedTuple):
    """An acceleration that is wanted: `jacobian @ a = wanted`, as far as more important ones let it.

    Attributes:
        jacobian: Shape (k, n), for n accelerations of the robot.
        wanted: Shape (k,) [m/s^2 or rad/s^2].
        weight: Cost of the square of a deviation.
    """

    jacobian: Array
    wanted: Array
    weight: float


class Gain(NamedTuple):
    """Stiffness and weight of a spring.

    Attributes:
        stiffness: For each unit of mass [1/s^2].
        weight: See `AccelerationTask`.
    """

    stiffness: float
    weight: float


def spring(motion: FrameMotion, rows: slice, error: Array, gain: Gain, feed: Array | float = 0.0) -> AccelerationTask:
    """Returns the task that pulls a part of a motion to its goal as a critically damped spring does.

    Args:
        motion: The motion.
        rows: The part of it.
        error: Way to the goal [m or rad].
        gain: Of the spring.
        feed: Velocity of the goal [m/s or rad/s].
    """
    wanted = pull(error, feed - motion.velocity[rows], gain)
    return AccelerationTask(motion.jacobian[rows], wanted - motion.drift[rows], gain.weight)


def pull(error: Array, velocity: Array, gain: Gain) -> Array:
    """Returns the acceleration of a critically damped spring by the way to its goal, and the velocity that it lacks."""
    acceleration: Array = gain.stiffness * error + 2.0 * np.sqrt(gain.stiffness) * velocity
    return acceleration


def capture(
    motion: FrameMotion, centre: Array, goal: Array, height: float, gain: float, weight: float
) -> AccelerationTask:
    """Returns the task that brings the capture point over a goal on the floor.

    The centre of mass c moves as that of a linear inverted pendulum, c'' = w^2 (c - p), with w^2 = g / height. The
    capture point is c + c'/w; the centre of pressure p is led beyond it by `gain` times its error, which pushes it back
    (Englsberger et al., "Bipedal walking control based on capture point dynamics", IROS 2011).

    Args:
        motion: How the centre of mass moves.
        centre: Where it is, shape (3,) [m].
        goal: Where it is to be above, shape (2,) [m].
        height: Its height over the floor [m].
        gain: How far p goes beyond, over the error.
        weight: See `AccelerationTask`.
    """
    w = np.sqrt(GRAVITY / height)
    capture_point = centre[:2] + motion.velocity[:2] / w
    pressure = capture_point + gain * (capture_point - goal)
    return AccelerationTask(motion.jacobian[:2], w * w * (centre[:2] - pressure) - motion.drift[:2], weight)


class Approach:
    """A point and an orientation that come to their target without haste.

    A critically damped spring pulls the point, no harder than at the length that leads to the largest speed. Both wait
    for the hand, so that a target out of reach does not pull the robot over.

    Args:
        position: Where it begins, shape (3,) [m].
        turn: The orientation there, 3 x 3.
        period_s: Time from one `advance` to the next [s].
        speed: Largest speed [m/s].

    Attributes:
        position: Of the point, shape (3,) [m].
        turn: The orientation, 3 x 3.
        velocity: Of the point, shape (3,) [m/s].
    """

    def __init__(self, position: Array, turn: Array, period_s: float, speed: float) -> None:
        self.position, self.turn = position.copy(), turn.copy()
        self.velocity = np.zeros(3)
        self._period_s, self._speed = period_s, speed

    def advance(self, target: Pose, position: Array, turn: Array) -> None:
        """Comes nearer to a target by a period.

        Args:
            target: The target in the world.
            position: Where the hand is, shape (3,) [m].
            turn: Its orientation, 3 x 3.
        """
        way = _shortened(target.position - self.position, 2.0 * self._speed / RATE)
        self.velocity += self._period_s * (RATE * RATE * way - 2.0 * RATE * self.velocity)
        self.position += self._period_s * self.velocity
        if np.linalg.norm(self.position - position) > LEASH_M:
            self.position = position + _shortened(self.position - position, LEASH_M)
            self.velocity = np.zeros(3)
        rest = turn_between(self.turn, rotation_of(target.quat_xyzw))
        self.turn = turned(self.turn, self._period_s * _shortened(RATE * rest, TURN_SPEED))
        self.turn = turned(turn, _shortened(turn_between(turn, self.turn), LEASH_RAD))


def _shortened(vector: Array, length: float) -> Array:
    long = float(np.linalg.norm(vector))
    return vector if long <= length else vector * (length / long)
