"""Effects of a plan, simulated in a fork of a world; execution of a plan in the world itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rpbi.world.forks.prediction import PlannedInput

from .group import Group
from .timing import PlannedTrajectory

if TYPE_CHECKING:
    from rpbi.world import World

Array = np.ndarray
SETTLING_S = 0.2
"""Time after the end of the motion that is simulated, too [s]."""


class Foreseen(NamedTuple):
    """Effects of a motion that is executed in a world.

    Attributes:
        contacts: Contacts of the robots that begin during the motion: time [s], the two bodies, and the force [N].
        joint_loads: Largest absolute effort of each joint [N m or N], by `robot/joint`.
        poses: Final pose of each body: position [m] and quaternion x, y, z, w, shape (7,).
        positions: Final positions of the moving joints [rad or m], by `robot/joint`.
        state_hash: Hash of the world's final state, see `World.state_hash`.
        ticks: Number of simulated ticks.
    """

    contacts: tuple[tuple[float, str, str, float], ...]
    joint_loads: Mapping[str, float]
    poses: Mapping[str, Array]
    positions: Mapping[str, float]
    state_hash: str
    ticks: int


def inputs_of(world: World, group: Group, trajectory: PlannedTrajectory) -> list[PlannedInput]:
    """Returns the joint targets of a motion, one for each tick; put them at these ticks to execute the motion."""
    dt_s = world.clock.dt_s
    count = int(np.ceil(trajectory.duration_s / dt_s)) + 1
    q = trajectory.at(np.arange(1, count + 1) * dt_s)
    found = []
    for r, robot in enumerate(group.robots):
        names = [robot.model.joint_names[i] for i in group.columns[r]]
        rows = q[:, group.slices[r]].tolist()
        found += [PlannedInput(tick, f"{robot.name}/target", dict(zip(names, row))) for tick, row in enumerate(rows)]
    return sorted(found, key=lambda each: each.tick)


def run(world: Any, inputs: list[PlannedInput], robots: list[str], ticks: int) -> Foreseen:
    """Executes planned inputs in a world, and returns what happens. The world advances by `ticks` ticks."""
    waiting, touching, contacts = list(inputs), set[tuple[str, str]](), list[tuple[float, str, str, float]]()
    loads: dict[str, float] = {}
    for tick in range(ticks):
        while waiting and waiting[0].tick <= tick:
            world.put(waiting[0].slot, waiting.pop(0).value)
        world.step()
        present = set()
        for name in robots:
            body = world.bodies[name]
            for point in body.pb.getContactPoints(bodyA=body.body_id):
                other = next((each.name for each in world.bodies.values() if each.body_id == point[2]), "")
                present.add((name, other))
                if (name, other) not in touching and other != name:
                    contacts.append(((tick + 1) * world.config.timeStep, name, other, float(point[9])))
                    touching.add((name, other))
            joints = list(body.model.moving)
            for joint, state in zip(joints, body.pb.getJointStates(body.body_id, [each.index for each in joints])):
                key = f"{name}/{joint.name}"
                loads[key] = max(loads.get(key, 0.0), abs(state[3]))
        touching &= present
    poses = {
        name: np.array((*body.base_pose().position, *body.base_pose().quat_xyzw))
        for name, body in world.bodies.items()
        if not body.is_soft
    }
    positions = {
        f"{name}/{joint.name}": world.bodies[name].joint_positions()[joint.index]
        for name in robots
        for joint in world.bodies[name].model.moving
    }
    return Foreseen(tuple(contacts), loads, poses, positions, world.state_hash(), ticks)


def ticks_of(world: World, trajectory: PlannedTrajectory) -> int:
    """Returns the number of ticks of a motion, with the time to settle."""
    return int(np.ceil((trajectory.duration_s + SETTLING_S) / world.config.timeStep)) + 1


def foresee_in(world: World, group: Group, trajectory: PlannedTrajectory) -> Foreseen:
    """Executes a motion in a fork of a world; the world itself does not change.

    Raises:
        InterfaceError: If the world cannot be forked.
    """
    inputs, ticks = inputs_of(world, group, trajectory), ticks_of(world, trajectory)
    (fork,) = world.fork()
    with fork:
        found: Foreseen = fork.call(run, inputs, [robot.name for robot in group.robots], ticks)
    return found


def execute(world: World, robots: list[str], trajectory: PlannedTrajectory, group: Group) -> Foreseen:
    """Executes a motion in a world as `foresee_in` does in a fork, and returns what happened."""
    return run(world, inputs_of(world, group, trajectory), robots, ticks_of(world, trajectory))
