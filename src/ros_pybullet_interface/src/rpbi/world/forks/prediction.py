"""Predictions: sequences of inputs, and the motion to which they lead."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.plugins import find
from custom_ros_tools.transforms import Array


class PlannedInput(NamedTuple):
    """An input at a later tick.

    Attributes:
        tick: Ticks from now on; 0 is before the next step.
        slot: The input, such as `kuka_lwr/target`, see `World.put`.
        value: Its value.
    """

    tick: int
    slot: str
    value: Any


Candidate = Sequence[PlannedInput]
"""Inputs by tick."""
Cost = Callable[[Any], float]
"""Cost of the state of a `World`, which counts at every tick."""


class PredictionJob(NamedTuple):
    """Extent of a prediction, and the motion to note.

    Attributes:
        ticks: Number of ticks.
        watch: Names of the bodies whose motion is noted.
        every: Ticks between two notes.
        cost: The cost, or `module:name` of it; None is 0.
    """

    ticks: int
    watch: tuple[str, ...]
    every: int
    cost: Cost | str | None


class Prediction(NamedTuple):
    """The predicted result of a candidate.

    Attributes:
        cost: Sum of the cost over all ticks; inf if it could not be predicted.
        state_hash: Hash of the state at the end, see `World.state_hash`.
        ticks: n ticks of the notes, from now on.
        poses: By body, positions [m] and orientations (x, y, z, w) of its base, shape (n, 7).
        joints: By robot, positions of its moving joints [rad or m], shape (n, joints), in the order of its model.
        contacts: By body, sum of the normal forces of all its contacts [N], shape (n,).
        fault: Reason why it could not be predicted.
    """

    cost: float
    state_hash: str = ""
    ticks: Array = np.empty(0, int)
    poses: Mapping[str, Array] = {}
    joints: Mapping[str, Array] = {}
    contacts: Mapping[str, Array] = {}
    fault: str = ""


def predict(world: Any, candidate: Candidate, job: PredictionJob) -> Prediction:
    """Steps a `World` with the inputs of a candidate, and returns the result.

    Raises:
        InterfaceError: If an input is refused, or its tick is not one of the job's.
        ValueError: If the cost is not finite.
    """
    cost: Cost | None = find(job.cost) if isinstance(job.cost, str) else job.cost
    if isinstance(cost, type):
        cost = cost()
    waiting = sorted((PlannedInput(*each) for each in candidate), key=lambda each: each.tick)
    for planned in waiting:
        if not 0 <= planned.tick < job.ticks:
            raise InterfaceError(f"{planned.slot}: expected a tick from 0 to {job.ticks - 1}, got {planned.tick}")
    notes = _Notes(world, job.watch)
    total, start = 0.0, world.clock.tick
    for tick in range(job.ticks):
        while waiting and waiting[0].tick <= tick:
            planned = waiting.pop(0)
            world.put(planned.slot, planned.value)
        world.step()
        if cost is not None:
            total += (cost_now := float(cost(world)))
            if not math.isfinite(cost_now):
                raise ValueError(f"cost: expected a finite number at tick {tick + 1}, got {cost_now}")
        if (tick + 1) % job.every == 0:
            notes.take(tick + 1)
    assert world.clock.tick == start + job.ticks
    return notes.prediction(total, world.state_hash())


class _Notes:
    """The motion of some bodies of a world."""

    def __init__(self, world: Any, watch: Sequence[str]) -> None:
        self._world, self._bodies = world, [world.bodies[name] for name in watch]
        self._ticks: list[int] = []
        self._poses: dict[str, list[Any]] = {body.name: [] for body in self._bodies}
        self._joints: dict[str, list[Any]] = {
            body.name: [] for body in self._bodies if hasattr(body, "joint_positions")
        }
        self._forces: dict[str, list[float]] = {body.name: [] for body in self._bodies}

    def take(self, tick: int) -> None:
        """Takes notes of the present state."""
        self._ticks.append(tick)
        for body in self._bodies:
            pose = body.base_pose()
            self._poses[body.name].append((*pose.position, *pose.quat_xyzw))
            if body.name in self._joints:
                self._joints[body.name].append(tuple(body.joint_positions().values()))
            touching = self._world.contacts.sample(body, self._world.clock.tick).points
            self._forces[body.name].append(sum(point.normal_force for point in touching))

    def prediction(self, cost: float, state_hash: str) -> Prediction:
        """Returns the notes as arrays."""
        poses, joints, forces = (
            {name: np.array(rows) for name, rows in each.items()} for each in (self._poses, self._joints, self._forces)
        )
        return Prediction(cost, state_hash, np.array(self._ticks, int), poses, joints, forces)
