"""Sends hostile targets to a guard and judges its commands."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np

from safe_robot.guard import Guard

from .adversary import Target, adversary
from .oracle import Oracle
from .scenes import Scene

CALM = {"limit": 0.6, "reject": 0.99}
"""Share of ordinary targets: a guard that has halted must be started again, and the robot is at rest then."""
RUN = 2000
"""Largest number of commands that are judged at once."""


class Report(NamedTuple):
    """Result of some targets.

    Attributes:
        targets: How many.
        commands: How many were answered by one.
        refused: How many gave no command as they are: those that are not safe by check, and those of one stamp.
        worst: Largest share of each limit.
        nearest_m: The smallest distance, inf if none was watched.
        brakings: How many brakings were followed to their end.
        faults: What was not safe.
    """

    targets: int
    commands: int
    refused: Counter[str]
    worst: dict[str, float]
    nearest_m: float
    brakings: int
    faults: list[str]


def fuzz(
    scene: Scene, guard: Guard, oracle: Oracle, count: int, generator: np.random.Generator, every: int = 10
) -> Report:
    """Sends hostile targets to a guard, and judges each command, and the complete braking motion from some of them.

    Args:
        scene: The robot and its surroundings.
        guard: A started guard of that robot.
        oracle: What judges.
        count: How many targets.
        generator: What they are random by.
        every: From so many commands one braking is judged.
    """
    targets = adversary(generator, oracle.lower, oracle.upper, count, CALM[guard.config.policy])
    next(targets)
    target, around = Target(tuple(scene.home.tolist())), scene.around
    run: list[tuple[float, ...]] = []
    last, from_rest = np.stack([scene.home] * 3), True
    commands, refused, brakings = 0, Counter[str](), 0
    for _ in range(count - 1):
        decision = guard.decide(target.position, around._replace(age_s=target.age_s, stamp_step_s=target.step_s))
        if decision.violation is not None:
            refused[decision.violation.check] += 1
        elif decision.command is None:
            refused["same stamp"] += 1
        if decision.command is not None:
            commands += 1
            run.append(decision.command)
            oracle.place(decision.command)
            if commands % every == 0 and len(stop := guard.stop_commands):
                brakings += 1
                for row in stop:
                    oracle.place(row)
                rest = [stop[-1].tolist()] * 3
                oracle.moves([*run[-4:], *stop.tolist(), *rest], from_rest and len(run) <= 4)
        if decision.is_halted:
            if run:
                oracle.moves(run, from_rest)
            run, from_rest, last = [], True, np.stack([last[-1]] * 3)
            guard.start()
        elif decision.command is not None:
            last = np.stack((*last[-2:], decision.command))
        if len(run) > RUN:
            oracle.moves(run, from_rest)
            run, from_rest = run[-4:], False
        target = targets.send(last)
    if run:
        oracle.moves(run, from_rest)
    return Report(count, commands, refused, oracle.worst, oracle.nearest_m, brakings, oracle.faults)
