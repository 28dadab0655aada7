"""Samplers find the best plan of a cost that is known, and wrong options are named."""

from __future__ import annotations

import numpy as np
import pytest

from custom_ros_tools.errors import ConfigError, UnknownNameError
from rpbi_mpc import LockStep, LoopConfig, Plant, Sensed
from rpbi_mpc.sampling import SAMPLERS, SamplingConfig, SamplingController

BEST = np.array([0.3, -0.2])


class Bowl:
    """A cost that is least where all commands are `BEST`; candidates that are too large cannot be simulated."""

    names = ("x", "y")
    lower, upper = np.array([-1.0, -1.0]), np.array([1.0, 1.0])
    largest = np.inf

    def __init__(self) -> None:
        self.asked: list[np.ndarray] = []

    def costs(self, commands: np.ndarray, period_s: float, delay_s: float) -> np.ndarray:
        self.asked.append(commands)
        costs = ((commands - BEST) ** 2).sum(axis=(1, 2))
        costs[np.abs(commands).max(axis=(1, 2)) > self.largest] = np.inf
        return costs


class Still(Plant):
    """A plant that remembers its commands."""

    def __init__(self) -> None:
        self.commands: list[np.ndarray] = []

    def sense(self) -> Sensed:
        return Sensed(0.0, np.array([0.0]))

    def act(self, command: np.ndarray) -> None:
        self.commands.append(command)

    def stand(self) -> None:
        """Stands anyway."""

    def advance(self, duration_s: float) -> None:
        """Lets no time pass."""


def run(rollouts: Bowl, cycles: int = 40, **config) -> tuple[Still, LockStep]:
    plant = Still()
    controller = SamplingController(rollouts, SamplingConfig(**config), 10.0, np.zeros(2))
    loop = LockStep(plant, controller, LoopConfig(hz=10.0))
    loop.run(cycles / 10.0)
    return plant, loop


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_the_best_command_is_found_and_is_the_same_again(sampler):
    plant, _ = run(Bowl(), sampler={"type": sampler})
    assert np.linalg.norm(plant.commands[-1] - BEST) < 0.1 < np.linalg.norm(BEST)
    again, _ = run(Bowl(), sampler={"type": sampler})
    assert np.array_equal(plant.commands, again.commands)
    other, _ = run(Bowl(), sampler={"type": sampler}, seed=1)
    assert not np.array_equal(plant.commands, other.commands)


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_candidates_obey_the_limits_and_the_first_is_the_plan(sampler):
    bowl = Bowl()
    bowl.lower, bowl.upper = np.array([-0.1, -0.1]), np.array([0.1, 0.1])
    plant, _ = run(bowl, 3, sampler={"type": sampler, "noise": 1.0})
    assert all((np.abs(each) <= 0.1 + 1e-12).all() for each in bowl.asked)
    assert np.array_equal(bowl.asked[0][0], np.zeros((5, 2)))


def test_loop_stops_if_no_candidate_can_be_simulated():
    bowl = Bowl()
    bowl.largest = 0.35
    plant, loop = run(bowl)
    assert np.abs(plant.commands).max() <= 0.35 and sum(each.plan.extras["not_simulated"] for each in loop.cycles) > 0
    bowl.largest = -1.0
    plant, loop = run(bowl)
    assert not plant.commands and loop.is_over
    assert loop.cycles[-1].reason.startswith("the solver did not converge: no candidate could be simulated")


@pytest.mark.parametrize(
    ("config", "error", "message"),
    [
        ({"sampler": {"type": "cen"}}, UnknownNameError, "did you mean 'cem'"),
        ({"sampler": {"type": "cem", "elites": 99}}, ConfigError, "sampler: elites: expected at most the 16"),
        ({"sampler": {"candidates": 1}}, ConfigError, "sampler: candidates: must be >= 2"),
        ({"sampler": {"temperature": 1.0}}, ConfigError, "sampler: temperature: unknown key"),
    ],
)
def test_wrong_options_are_named(config, error, message):
    with pytest.raises(error, match=message):
        run(Bowl(), **config)
