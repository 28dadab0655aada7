"""Parts of observations: numbers read from a world, each with a lower and an upper bound."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from custom_ros_tools.errors import MissingDependency, PhysicsError, UnknownNameError
from rpbi.bodies import Body
from rpbi.bodies.robots.robot import Robot
from rpbi.sensors.link_pose import index_of_link
from rpbi.world import World

try:
    from gymnasium import spaces
except ImportError:
    raise MissingDependency("gymnasium", "./rpbi setup gym") from None

Observation = dict[str, npt.NDArray[np.float32]]

FARTHEST = 1e3
"""Maximum bound of joint positions [rad or m] and velocities [rad/s or m/s], also without a limit in the URDF."""
LARGEST_FORCE_N, LARGEST_TORQUE_NM = 1e3, 1e2
"""Bounds of measured forces and torques; larger values are clipped."""


class ObservationPart(NamedTuple):
    """A part of an observation: one entry of the observation dictionary, an array of n numbers.

    Attributes:
        name: Key of the entry.
        low: Lower bounds of the numbers, length n.
        high: Upper bounds of the numbers, length n.
        read: Function that returns the present numbers.
    """

    name: str
    low: Sequence[float]
    high: Sequence[float]
    read: Callable[[], Sequence[float]]


class Parts:
    """All parts of an observation, read together.

    Attributes:
        space: Space of the observation: a dictionary of float32 boxes.
    """

    def __init__(self, parts: Sequence[ObservationPart]) -> None:
        self._parts = tuple(parts)
        self._low = np.array([each for part in parts for each in part.low], np.float32)
        self._high = np.array([each for part in parts for each in part.high], np.float32)
        ends = np.cumsum([len(part.low) for part in parts]).tolist()
        self._slices = {part.name: slice(end - len(part.low), end) for part, end in zip(parts, ends)}
        self.space = spaces.Dict(
            {name: spaces.Box(self._low[each], self._high[each]) for name, each in self._slices.items()}
        )

    def read(self) -> Observation:
        """Returns the present observation, clipped to the bounds.

        Raises:
            PhysicsError: If a number is not finite.
        """
        numbers = np.array([each for part in self._parts for each in part.read()])
        if not math.isfinite(numbers.sum()):
            names = [part.name for part in self._parts if not np.isfinite(numbers[self._slices[part.name]]).all()]
            raise PhysicsError(f"not finite any more: {', '.join(names)}")
        clipped = np.minimum(np.maximum(numbers.astype(np.float32), self._low), self._high)
        return {name: clipped[each] for name, each in self._slices.items()}


def joint_part(world: World, robot: str) -> ObservationPart:
    """Returns the part for a robot's driven joints: positions [rad or m], then velocities [rad/s or m/s]."""
    joints = robot_of(world, robot).model.driven
    indices = [joint.index for joint in joints]
    speeds = [min(joint.max_velocity, FARTHEST) for joint in joints]

    def read() -> Sequence[float]:
        body = world.bodies[robot]
        positions, velocities, *_ = zip(*body.pb.getJointStates(body.body_id, indices))
        return (*positions, *velocities)

    lower = [max(joint.lower, -FARTHEST) for joint in joints]
    upper = [min(joint.upper, FARTHEST) for joint in joints]
    return ObservationPart(f"{robot}/joints", [*lower, *(-speed for speed in speeds)], [*upper, *speeds], read)


def sensor_parts(world: World, robot: str) -> Iterator[ObservationPart]:
    """Yields a part for each force-torque sensor of a robot: force [N], then torque [N m]; 0 without a measurement."""
    high = (LARGEST_FORCE_N,) * 3 + (LARGEST_TORQUE_NM,) * 3

    def read(number: int) -> Sequence[float]:
        sample = robot_of(world, robot).force_torque_sensors[number].read(world.clock.tick)
        return (0.0,) * 6 if sample is None else (*sample.force, *sample.torque)

    for number, sensor in enumerate(robot_of(world, robot).force_torque_sensors):
        yield ObservationPart(f"{sensor.name}/wrench", [-each for each in high], high, partial(read, number))


def pose_part(world: World, name: str, low: Sequence[float], high: Sequence[float]) -> ObservationPart:
    """Returns the part for a body's base pose in the world frame: position [m], then quaternion x, y, z, w.

    The arguments `low` and `high` are the bounds [m] of the position.
    """

    def read() -> Sequence[float]:
        position, quat = world.bodies[name].base_pose()
        return (*position, *quat)

    return ObservationPart(f"{name}/pose", (*low, *(-1.0,) * 4), (*high, *(1.0,) * 4), read)


def robot_of(world: World, name: str) -> Robot:
    """Returns the robot with a given name; the robot must have motors.

    Raises:
        UnknownNameError: If the world has no robot of this name with motors.
    """
    found = world.bodies.get(name)
    if not isinstance(found, Robot):
        known = [each for each, body in world.bodies.items() if isinstance(body, Robot)]
        raise UnknownNameError("robot", name, known)
    return found


def link_index(body: Body, link: str) -> int:
    """Returns PyBullet's index of a link.

    Raises:
        ValueError: If the body has no such link.
    """
    index = index_of_link(body, link)
    if index is None:
        known = ", ".join(body.link_name(each) for each in (-1, *body.link_indices))
        raise ValueError(f"expected a link of '{body.name}', which are {known}; got '{link}'")
    return index
