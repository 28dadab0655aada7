"""Predicts motion: simulates a sequence of inputs, and samples the resulting motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.plugins import find
from custom_ros_tools.transforms import Array


class PlannedInput(NamedTuple):
    """An input, and the tick of a prediction at which the input is applied.

    Attributes:
        tick: Number of ticks after the start of the prediction; 0 means before the first step.
        slot: Name of the input, such as `kuka_lwr/target`, see `World.put`.
        value: Value for the input.
    """

    tick: int
    slot: str
    value: Any


Candidate = Sequence[PlannedInput]
"""Inputs whose effect is predicted; inputs at the same tick are applied in the given order."""
Cost = Callable[[Any], float]
"""A function that returns the cost of a `World`'s present state; it is called after every tick."""


class PredictionJob(NamedTuple):
    """Options of a prediction.

    Attributes:
        ticks: Number of ticks to simulate.
        watch: Names of the bodies whose motion is sampled.
        every: Number of ticks between two samples.
        cost: Cost function, a class whose objects are cost functions, or `module:name` of either. None means cost 0.
    """

    ticks: int
    watch: tuple[str, ...]
    every: int
    cost: Cost | str | None


class Prediction(NamedTuple):
    """Result of a prediction, with n samples of the motion.

    Attributes:
        cost: Sum of the costs of the states after each tick; inf if the prediction failed.
        state_hash: Hash of the state at the end, see `World.state_hash`.
        ticks: Ticks of the samples, counted from the start of the prediction, shape (n,).
        poses: For each body, positions [m] and quaternions (x, y, z, w) of the base in the world frame, shape (n, 7).
        joints: For each robot, positions [rad or m] of the moving joints in the order of the joint model, shape
            (n, number of joints).
        contacts: For each body, sum of the normal forces [N] of all contacts, shape (n,).
        fault: Reason why the prediction failed; empty if it succeeded.
    """

    cost: float
    state_hash: str = ""
    ticks: Array = np.empty(0, int)
    poses: Mapping[str, Array] = {}
    joints: Mapping[str, Array] = {}
    contacts: Mapping[str, Array] = {}
    fault: str = ""


def predict(world: Any, candidate: Candidate, job: PredictionJob) -> Prediction:
    """Simulates a `World` with the input sequence `candidate`, and returns the cost and the sampled motion.

    Raises:
        InterfaceError: If an input is unknown, or its tick is not within the prediction.
        ValueError: If the value of an input is refused, or the cost is not finite.
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
    """Samples of the motion of the watched bodies."""

    def __init__(self, world: Any, watch: Sequence[str]) -> None:
        self._world, self._bodies = world, [world.bodies[name] for name in watch]
        self._ticks: list[int] = []
        self._poses: dict[str, list[Any]] = {body.name: [] for body in self._bodies}
        self._joints: dict[str, list[Any]] = {
            body.name: [] for body in self._bodies if hasattr(body, "joint_positions")
        }
        self._forces: dict[str, list[float]] = {body.name: [] for body in self._bodies}

    def take(self, tick: int) -> None:
        """Samples the present state.

        Args:
            tick: Number of ticks since the start of the prediction.
        """
        self._ticks.append(tick)
        for body in self._bodies:
            pose = body.base_pose()
            self._poses[body.name].append((*pose.position, *pose.quat_xyzw))
            if body.name in self._joints:
                self._joints[body.name].append(tuple(body.joint_positions().values()))
            touching = self._world.contacts.sample(body, self._world.clock.tick).points
            self._forces[body.name].append(sum(point.normal_force for point in touching))

    def prediction(self, cost: float, state_hash: str) -> Prediction:
        """Returns a `Prediction` with all samples as arrays, and with `cost` and `state_hash`."""
        poses, joints, forces = (
            {name: np.array(rows) for name, rows in each.items()} for each in (self._poses, self._joints, self._forces)
        )
        return Prediction(cost, state_hash, np.array(self._ticks, int), poses, joints, forces)
