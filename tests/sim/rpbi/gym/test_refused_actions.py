"""Actions of a wrong type, shape or value are refused, and leave the episode as it was."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from gym_world import made, write
from gymnasium import spaces
from gymnasium.utils.env_checker import data_equivalence

from rpbi.gym.checks import check_action
from rpbi.gym.vector_env import WorldVectorEnv

DELAYED = {"delays": {"observation_s": [0.02, 0.02], "action_s": [0.02, 0.02]}}
GOOD = np.array([0.9], np.float32)
WRONG: dict[str, tuple[Any, str]] = {
    "nan": ([np.nan], r"action: expected finite numbers, got \[nan\]"),
    "infinite": (np.array([-np.inf]), "expected finite numbers"),
    "too long": (np.zeros(7), r"action: expected the shape \(1,\), got \(7,\)"),
    "empty": ([], "expected the shape"),
    "a number": (0.5, "expected the shape"),
    "nested": ([[0.5]], "expected the shape"),
    "ragged": ([[0.5], 0.5], "expected numbers of shape"),
    "a text": ("left", "action: expected numbers of shape .* got 'left'"),
    "texts": (["0.5"], "expected numbers"),
    "nothing": (None, "expected numbers"),
    "complex": ([1j], "expected numbers"),
    "a mapping": ({"swing": 0.5}, "expected numbers"),
    "huge": ([10**400], "expected numbers"),
}


@pytest.mark.parametrize("randomization", [None, DELAYED], ids=["at once", "delayed"])
def test_refused_actions_leave_the_episode_as_it_was(tmp_path, randomization):
    env = made(tmp_path, randomization=randomization)
    draw = np.random.default_rng(3)
    first = env.reset(seed=1)
    expected = [env.step(GOOD) for _ in range(6)]
    end = env.world.state_hash()
    assert data_equivalence(env.reset(seed=1), first)
    for result in expected:
        before = env.world.state_hash()
        for name in draw.permutation(list(WRONG)):
            action, message = WRONG[name]
            with pytest.raises(ValueError, match=message):
                env.step(action)
        assert env.world.state_hash() == before
        action = GOOD.copy()
        assert data_equivalence(env.step(action), result)
        action[:] = -1.0  # it is the caller's again
    assert env.world.state_hash() == end
    env.close()


def test_a_vector_refuses_before_any_environment_acts(tmp_path):
    write(tmp_path)
    envs = WorldVectorEnv([partial(made, tmp_path)] * 2, 1)
    first, actions = envs.reset(seed=1), np.array([GOOD, GOOD])
    expected = [envs.step(actions) for _ in range(3)]
    assert data_equivalence(envs.reset(seed=1), first)
    for result in expected:
        for action, message in WRONG.values():
            with pytest.raises(ValueError, match=message.replace("action:", r"actions\[1\]:")):
                envs.step([GOOD, action])
        with pytest.raises(ValueError, match="expected 2 actions, got 1"):
            envs.step(actions[:1])
        assert data_equivalence(envs.step(actions), result)
    envs.close()


def test_spaces_of_other_kinds_are_checked():
    space = spaces.Dict({"arm": spaces.Box(-1.0, 1.0, (2,), np.float32), "grip": spaces.Discrete(2)})
    check_action(space, {"arm": [3.0, 0.0], "grip": 1})
    for action, message in (
        ({"arm": [3.0, np.nan], "grip": 1}, r"action\['arm'\]: expected finite numbers"),
        ({"arm": [3.0, 0.0], "grip": 2}, r"action\['grip'\]: expected one of Discrete\(2\), got 2"),
        ({"arm": [3.0, 0.0]}, r"action: expected one of Dict\("),
    ):
        with pytest.raises(ValueError, match=message):
            check_action(space, action)
