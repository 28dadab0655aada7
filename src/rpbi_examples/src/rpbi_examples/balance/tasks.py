"""Tasks of a whole-body controller: desired accelerations of parts of the robot, and the moving target of a hand."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_model.geometry import Pose
from rpbi.control.controllers.controller import Array

from .dynamics import FrameMotion, rotation_of, turn_between, turned

GRAVITY = 9.81
"""Acceleration due to gravity [m/s^2]."""
RATE = 6.0
"""Rate at which `Approach` reduces the remaining distance and angle [1/s]."""
TURN_SPEED = 1.5
"""Largest angular speed of `Approach` [rad/s]."""
LEASH_M, LEASH_RAD = 0.05, 0.3
"""Largest distance [m] and angle [rad] between the pose of `Approach` and the hand."""


class AccelerationTask(NamedTuple):
    """Condition that the accelerations a of the robot should fulfil: `jacobian @ a = wanted`.

    Attributes:
        jacobian: Shape (k, n), for n accelerations of the robot.
        wanted: Desired acceleration, shape (k,) [m/s^2 or rad/s^2].
        weight: Factor of the squared deviation from `wanted` in the cost.
    """

    jacobian: Array
    wanted: Array
    weight: float


class Gain(NamedTuple):
    """Stiffness of a virtual spring, and the weight of the spring's task in the cost.

    Attributes:
        stiffness: Stiffness divided by mass [1/s^2].
        weight: Factor of the squared deviation from the spring's acceleration in the cost.
    """

    stiffness: float
    weight: float


def spring(motion: FrameMotion, rows: slice, error: Array, gain: Gain, feed: Array | float = 0.0) -> AccelerationTask:
    """Returns a task that pulls a frame towards a goal like a critically damped spring.

    Args:
        motion: Present motion of the frame.
        rows: The k rows of `motion` on which the spring acts.
        error: Goal minus present value in these rows, shape (k,) [m or rad].
        gain: Stiffness of the spring, and the task's weight in the cost.
        feed: Velocity of the goal in these rows, shape (k,) [m/s or rad/s]. Default: a goal at rest.
    """
    wanted = pull(error, feed - motion.velocity[rows], gain)
    return AccelerationTask(motion.jacobian[rows], wanted - motion.drift[rows], gain.weight)


def pull(error: Array, velocity: Array, gain: Gain) -> Array:
    """Returns the acceleration of a critically damped spring.

    Args:
        error: Goal minus present position [m or rad].
        velocity: Velocity of the goal minus present velocity [m/s or rad/s].
        gain: Stiffness of the spring; `weight` is not used.
    """
    acceleration: Array = gain.stiffness * error + 2.0 * np.sqrt(gain.stiffness) * velocity
    return acceleration


def capture(
    motion: FrameMotion, centre: Array, goal: Array, height: float, gain: float, weight: float
) -> AccelerationTask:
    """Returns the task that brings the capture point over a goal on the floor.

    The centre of mass c moves like a linear inverted pendulum over the centre of pressure p: c'' = w^2 (c - p) with
    w^2 = g / height. The capture point is c + c'/w. As seen from the goal, the task places p beyond the capture point.
    The capture point then moves back to the goal. Source: Englsberger et al., "Bipedal walking control based on
    capture point dynamics", IROS 2011.

    Args:
        motion: Motion of the centre of mass.
        centre: Position of the centre of mass, shape (3,) [m].
        goal: Desired x and y of the capture point, shape (2,) [m].
        height: Height of the centre of mass above the floor [m].
        gain: Distance from the capture point to p, divided by the distance from the goal to the capture point.
        weight: Factor of the squared deviation from the desired acceleration of the centre of mass in the cost.
    """
    w = np.sqrt(GRAVITY / height)
    capture_point = centre[:2] + motion.velocity[:2] / w
    pressure = capture_point + gain * (capture_point - goal)
    return AccelerationTask(motion.jacobian[:2], w * w * (centre[:2] - pressure) - motion.drift[:2], weight)


class Approach:
    """A pose that moves from the hand to the hand's target at limited speed.

    A critically damped spring with limited force pulls the position towards the target. The limit of the force limits
    the speed. The pose stays near the hand, so that an unreachable target does not make the robot fall.

    Args:
        position: Initial position, shape (3,) [m].
        turn: Initial orientation as a rotation matrix, shape (3, 3).
        period_s: Time between two calls of `advance` [s].
        speed: Largest linear speed [m/s].

    Attributes:
        position: Position of the moving pose, shape (3,) [m].
        turn: Orientation of the moving pose, shape (3, 3).
        velocity: Linear velocity of the moving pose, shape (3,) [m/s].
    """

    def __init__(self, position: Array, turn: Array, period_s: float, speed: float) -> None:
        self.position, self.turn = position.copy(), turn.copy()
        self.velocity = np.zeros(3)
        self._period_s, self._speed = period_s, speed

    def advance(self, target: Pose, position: Array, turn: Array) -> None:
        """Moves the pose towards a target for the time `period_s`.

        Args:
            target: Target pose of the hand in the world.
            position: Present position of the hand, shape (3,) [m].
            turn: Present orientation of the hand as a rotation matrix, shape (3, 3).
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
