"""The scripted session in a layout by seed, among bodies that sleep, are woken and sleep again."""

from __future__ import annotations

import random
from pathlib import Path

import pybullet
import scripted_session
from scripted_session import Layout, Script
from worlds import ball, box

from rpbi.config.pybullet_models import ChangeDynamics
from rpbi.control.external_wrenches import ExternalWrench
from rpbi.geometry import Pose
from rpbi.world import World

SLEEPERS = tuple(f"sleeper{turn}" for turn in range(6))
TIME_STEPS_S = (0.001, 0.002, 0.005)
"""With the longest, bodies that rest fall asleep by themselves after 400 ticks, which is 2 s."""
MAY_SLEEP, SLEEPS = "ACTIVATION_STATE_ENABLE_SLEEPING", "ACTIVATION_STATE_ENABLE_SLEEPING|ACTIVATION_STATE_SLEEP"


def build(folder: Path, seed: int) -> World:
    """Builds the world of a seed."""
    draw = random.Random(seed)
    layout = Layout(
        {f"lbr_iiwa_joint_{number}": draw.uniform(-60.0, 60.0) for number in range(1, 8)},
        [(draw.uniform(0.35, 0.65), draw.uniform(-0.3, 0.3), 0.1 + 0.21 * turn) for turn in range(5)],
        (draw.uniform(-1.2, -0.8), draw.uniform(-0.5, 0.5), 0.0),
        tuple(_sleeper(draw, turn) for turn in range(len(SLEEPERS))),
        {"timeStep": draw.choice(TIME_STEPS_S)},
    )
    return scripted_session.build(folder, layout)


def _sleeper(draw: random.Random, turn: int) -> dict:
    """Returns a body that lies on the floor, a box in turn with a ball; the last one is in maximal coordinates."""
    place = [-0.75 + 0.3 * turn, draw.choice((-1.0, 1.0)) * draw.uniform(0.5, 1.2), 0.1]
    dynamics = {"activationState": draw.choice((MAY_SLEEP, SLEEPS))}
    if turn == len(SLEEPERS) - 1:
        return box(SLEEPERS[turn], basePosition=place, changeDynamics=dynamics, useMaximalCoordinates=True)
    return (box if turn % 2 else ball)(SLEEPERS[turn], basePosition=place, changeDynamics=dynamics)


class SleepingScript(Script):
    """A script that also puts bodies to sleep, and wakes them by what it does to them."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self._sleep_random = random.Random(seed)

    def act(self, world: World) -> None:
        """Does what the script has for a tick."""
        super().act(world)
        draw = self._sleep_random
        if draw.random() < 0.97:
            return
        name, kind = draw.choice(SLEEPERS), draw.randrange(6)
        if kind == 0:
            world.change_dynamics(name, ChangeDynamics(activationState=pybullet.ACTIVATION_STATE_WAKE_UP))
        elif kind == 1:
            force = (draw.uniform(-20.0, 20.0), draw.uniform(-20.0, 20.0), 0.0)
            world.act(name, "push", ExternalWrench(force, duration_s=0.05))
        elif kind == 2:
            place = (draw.uniform(-1.0, 1.0), draw.choice((-1.0, 1.0)) * draw.uniform(0.5, 1.2), 0.1)
            world.act(name, "teleport", Pose(place))
        else:
            world.change_dynamics(name, ChangeDynamics(activationState=pybullet.ACTIVATION_STATE_SLEEP))


def run(world: World, seed: int, ticks: int) -> None:
    """Runs the script of a seed."""
    scripted_session.run(world, seed, ticks, script=SleepingScript)


def sleeping(world: World) -> list[str]:
    """Returns the bodies that sleep: they do not notice another gravity. It is for forks, whose motion it changes."""
    before = {name: world.bodies[name].motion_state() for name in SLEEPERS}
    world.pb.setGravity(1.0, 2.0, 30.0)
    world.pb.stepSimulation()
    return [name for name, state in before.items() if world.bodies[name].motion_state() == state]
