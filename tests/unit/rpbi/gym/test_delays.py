"""Delays of environments: which action acts when, and which observation comes when."""

from __future__ import annotations

import pytest

from rpbi.gym.env import DelayLine


def run(observation_ticks: int, action_ticks: int, actions: int = 4, ticks: int = 10) -> tuple[list, list]:
    """Returns (action, tick at which it began), and the tick of each observation."""
    now, begun, line = 0, [], DelayLine(ticks, observation_ticks, action_ticks, 0)

    def step() -> None:
        nonlocal now
        now += 1

    seen = [line.run(each, lambda action: begun.append((action, now)), step, lambda: now) for each in range(actions)]
    return begun, seen


def test_without_delay_actions_act_at_once_and_observations_are_new():
    assert run(0, 0) == ([(0, 0), (1, 10), (2, 20), (3, 30)], [10, 20, 30, 40])


@pytest.mark.parametrize(
    ("delay", "seen"), [(3, [7, 17, 27, 37]), (10, [0, 10, 20, 30]), (25, [0, 0, 5, 15])], ids=["3", "10", "25"]
)
def test_observations_are_as_old_as_asked_for(delay, seen):
    assert run(delay, 0)[1] == seen


@pytest.mark.parametrize(("delay", "begun"), [(3, [3, 13, 23, 33]), (25, [25, 35])])
def test_actions_begin_to_act_as_late_as_asked_for(delay, begun):
    assert run(0, delay)[0] == list(enumerate(begun))
