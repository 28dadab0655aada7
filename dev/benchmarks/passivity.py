"""Force feedback in virtual time: checks that a handle never gives out more energy than was put in, for any simulator.

The controller is the one of the haptic node, tick by tick. A hand on a handle wanders into a wall that a simulator has,
at a rate of its own, behind a delay and a loss in each direction. Energy is also counted independently, from the hand's
forces and positions.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import random
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from result import Result, Target

from operator_node.haptics.config import ForceFeedbackConfig
from operator_node.haptics.controller import HapticController
from operator_node.haptics.coupling import Mode
from operator_node.haptics.device import HapticConfig, HapticReading
from operator_node.haptics.emulated import Hand
from robot_model.geometry import Vector

SET_UPS = "PASSIVITY_SET_UPS"
"""Environment variable: how many random set-ups to try in place of 1,000."""
TICKS = 10_000
LONG, LONG_TICKS = 5, 1_000_000
"""Seed and ticks of the long trial, which is far from passive on its own: a stiff wall behind a delay of 19 ms."""
DT_S = 0.001
MAX_FORCE_N = 10.0
MAX_ACCELERATION = 200.0
RESOLUTIONS_M = (5e-6, 20e-6)
"""Steps in which half of the devices measure each axis; the others are exact."""


def leak_j(resolution_m: float) -> float:
    """Returns the energy that the handle may give out beyond the energy put in, see docs/haptics.md."""
    return MAX_FORCE_N * (MAX_ACCELERATION * DT_S**2 + 2.5 * math.sqrt(3.0) * resolution_m)


class SetUp(NamedTuple):
    """One experiment.

    Attributes:
        seed: Of everything random in it.
        mode: What the person feels.
        stiffness: Of the wall, or of the coupling [N/m].
        damping: Of the coupling [N s/m].
        simulator_hz: How often the simulator steps [Hz].
        delay_s: Of each direction [s].
        loss: Share of the messages that do not arrive.
        resolution_m: Steps in which the device measures each axis; 0 is exact.
    """

    seed: int
    mode: Mode
    stiffness: float
    damping: float
    simulator_hz: float
    delay_s: float
    loss: float
    resolution_m: float = 0.0


class Outcome(NamedTuple):
    """Result of a run.

    Attributes:
        least_j: The least energy that there was in the handle [J].
        acceleration: The largest [m/s^2].
        largest_n: The largest force [N].
        interventions: At how many ticks the controller did something.
        leak_j: The energy that it may have returned beyond the energy that was put in [J].
    """

    least_j: float
    acceleration: float
    largest_n: float
    interventions: int
    leak_j: float

    @property
    def is_passive(self) -> bool:
        """Whether the handle never gave out more than the leak."""
        return self.least_j >= -self.leak_j * (1.0 + 1e-9)


def set_up(seed: int) -> SetUp:
    """Returns a random one."""
    draw = random.Random(seed)
    mode: Mode = "wrench" if seed % 2 else "coupling"
    return SetUp(
        seed,
        mode,
        math.exp(draw.uniform(math.log(100.0), math.log(3000.0))),
        draw.uniform(0.0, 3.0),
        math.exp(draw.uniform(math.log(50.0), math.log(1000.0))),
        draw.uniform(0.0, 0.02),
        draw.uniform(0.0, 0.05),
        draw.uniform(*RESOLUTIONS_M) if draw.random() < 0.5 else 0.0,
    )


class Link:
    """Messages that arrive later, or never."""

    def __init__(self, delay_s: float, loss: float, draw: random.Random) -> None:
        self._delay_s, self._loss, self._draw = delay_s, loss, draw
        self._way: deque[tuple[float, float]] = deque()

    def send(self, value: float, now_s: float) -> None:
        """Sends a number."""
        if self._draw.random() >= self._loss:
            self._way.append((now_s + self._delay_s, value))

    def received(self, now_s: float) -> float | None:
        """Returns the newest that has arrived since the last call, None without any."""
        found = None
        while self._way and self._way[0][0] <= now_s:
            found = self._way.popleft()[1]
        return found


def wandering(draw: random.Random) -> Callable[[float], Vector]:
    """Returns where a hand wants to be over time: it wanders along z, through the wall at 0, and a little aside."""
    waves = [
        (draw.uniform(0.005, 0.03), math.tau * draw.uniform(0.2, 2.5), draw.uniform(0.0, math.tau)) for _ in range(3)
    ]

    def wanted(time_s: float) -> Vector:
        z = sum(size * math.sin(rate * time_s + phase) for size, rate, phase in waves)
        return 0.3 * z, 0.0, z

    return wanted


def measured(position: Vector, resolution_m: float) -> Vector:
    """Returns a position as a device measures it, in steps of its resolution."""
    if resolution_m == 0.0:
        return position
    x, y, z = (round(value / resolution_m) * resolution_m for value in position)
    return x, y, z


def run_set_up(case: SetUp, ticks: int = TICKS, passivity: bool = True, is_resolution_known: bool = True) -> Outcome:
    """Runs one experiment, with the passivity controller or without it.

    Args:
        case: The experiment.
        ticks: Its length.
        passivity: Whether the controller changes forces.
        is_resolution_known: Whether the controller knows the device's resolution; else it counts it as exact.
    """
    known_m = case.resolution_m if is_resolution_known else 0.0
    draw = random.Random(case.seed)
    wanted = wandering(draw)
    hand = Hand(draw.uniform(0.2, 0.6), draw.uniform(50.0, 600.0), draw.uniform(0.5, 10.0))
    config = ForceFeedbackConfig(
        mode=case.mode, stiffness=case.stiffness, damping=case.damping, passivity=passivity, slew_n_per_s=10_000.0
    )
    controller = HapticController(
        config,
        HapticConfig(
            max_force_n=MAX_FORCE_N,
            workspace_m=0.2,
            max_acceleration=MAX_ACCELERATION,
            resolution_m=known_m,
        ),
        1.0 / DT_S,
    )
    there, back = (Link(case.delay_s, case.loss, draw) for _ in range(2))
    next_step_s, tool = 0.0, 0.0
    energy_j = least_j = 0.0
    acceleration = largest_n = 0.0
    before = two_before = hand.position
    for tick in range(ticks):
        now_s = tick * DT_S
        # the simulator: a tool that follows the handle, and a wall below 0
        received = there.received(now_s)
        tool = tool if received is None else received
        if now_s >= next_step_s:
            next_step_s += 1.0 / case.simulator_hz
            back.send(max(tool, 0.0) if case.mode == "coupling" else max(-tool, 0.0) * case.stiffness, now_s)
        felt = back.received(now_s)
        if felt is not None:
            if case.mode == "coupling":
                controller.observe_tool((0.0, 0.0, felt), now_s)
            else:
                controller.observe_wrench((0.0, 0.0, felt), now_s)
        # the haptic node
        force = controller.tick(now_s, HapticReading(measured(hand.position, case.resolution_m)))
        there.send(controller.snapshot.displacement[2], now_s)
        # the hand, and the energy put into the handle: previous force times displacement
        largest_n = max(largest_n, math.hypot(*force))
        hand.step(wanted(now_s), force, DT_S)
        x, y, z = hand.position
        bx, by, bz = before
        energy_j -= force[0] * (x - bx) + force[1] * (y - by) + force[2] * (z - bz)
        least_j = min(least_j, energy_j)
        if tick:
            cx, cy, cz = two_before
            acceleration = max(acceleration, math.hypot(x - 2 * bx + cx, y - 2 * by + cy, z - 2 * bz + cz) / DT_S**2)
        two_before, before = before, hand.position
    return Outcome(least_j, acceleration, largest_n, controller.passivity.interventions, leak_j(known_m))


def _with_and_without(seed: int) -> tuple[Outcome, Outcome]:
    return run_set_up(set_up(seed)), run_set_up(set_up(seed), passivity=False)


def run(quick: bool) -> list[Result]:
    """Runs 1,000 random set-ups of 10,000 ticks, with and without the controller, and one of a million.

    Args:
        quick: Whether a twentieth of that will do.
    """
    count = int(os.environ.get(SET_UPS, 50 if quick else 1000))
    with multiprocessing.Pool() as pool:
        long = pool.apply_async(run_set_up, (set_up(LONG), LONG_TICKS // (20 if quick else 1)))
        pairs = pool.map(_with_and_without, range(count), chunksize=5)
        outcomes = [on for on, _ in pairs]
        without = [off for _, off in pairs]
        one = long.get()
    passive = 100.0 * sum(each.is_passive for each in outcomes) / count
    failing = 100.0 * sum(not each.is_passive for each in without) / count
    worst = max(-each.least_j / each.leak_j for each in outcomes)
    what = f"{count} set-ups of {TICKS} ticks"
    return [
        Result("passivity", f"{what}: passive", passive, "%", None, Target(100.0, at_least=True)),
        Result("passivity", f"{what}: energy given out, of the bound", 100.0 * worst, "%", None, Target(100.0)),
        Result("passivity", f"{what}: not passive without the controller", failing, "%", None, Target(30.0, True)),
        Result("passivity", "a long one: least energy", 1e3 * one.least_j, "mJ", None, Target(-1e3 * one.leak_j, True)),
    ]
