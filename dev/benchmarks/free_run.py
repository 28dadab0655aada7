"""Processor time of a step through the node, as fast as possible, compared with the same PyBullet calls in a bare loop.

It is the time of the stepping thread. On an idle machine it equals the duration of a step.
"""

from __future__ import annotations

from typing import Any

from bench_worlds import arm_world, write_main
from result import Result, Target
from session import JOINT_STATES, Session

HZ = 1000
JOINT_STATES_HZ = 50
MIN_DIAGNOSTICS_S = 4.0
"""Published once a second, so that at least three messages arrive and the time between them can be measured."""


def run(quick: bool) -> list[Result]:
    """Measures both alternately, with a subscriber of the joint states and with one of /diagnostics only; best of all
    runs.
    """
    rounds, seconds = (3, 2.0) if quick else (5, 5.0)
    alone, subscribed, unseen = [], [], []
    with Session() as ros:
        world = arm_world(ros.folder, HZ, JOINT_STATES_HZ, tf=False, real_time_factor=0)
        path = write_main(ros.folder, world)
        for _ in range(rounds):
            program = ros.program("step_alone", path, seconds, JOINT_STATES_HZ)
            alone.append(ros.result_of(program))
            subscribed.append(_step_s(ros, world, JOINT_STATES, seconds))
            unseen.append(_step_s(ros, world, "/diagnostics", max(seconds, MIN_DIAGNOSTICS_S)))
    value_us, unseen_us, floor_us = (min(times) * 1e6 for times in (subscribed, unseen, alone))
    return [
        Result("free_run", "a step, joint states subscribed", value_us, "us", floor_us, Target(1.1, of_floor=True)),
        Result(
            "free_run", "a step, joint states not subscribed", unseen_us, "us", floor_us, Target(1.05, of_floor=True)
        ),
    ]


def _step_s(ros: Session, world: dict[str, Any], topic: str, seconds: float) -> float:
    """Returns the mean processor time of a step [s], by the stamps of the only topic that is subscribed to."""
    simulator = ros.simulator(world)
    found = ros.watch(topic, seconds=seconds, stock=False, spent_by=simulator).arrivals()[topic]
    ros.stop(simulator)
    return found.processor_share / HZ
