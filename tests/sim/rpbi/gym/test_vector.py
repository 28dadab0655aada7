"""Vectors of environments in worker processes are those of Gymnasium, to the last bit."""

from __future__ import annotations

import os
import signal
from functools import partial

import numpy as np
import pytest
from gym_world import made, write
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv

from custom_ros_tools.errors import InterfaceError, PluginError
from rpbi.gym.vector_env import WorldVectorEnv

VARIED = {"poses": [{"object": "box", "position": [0.02, 0.02, 0.0]}]}
COUNT = 3


@pytest.fixture(autouse=True)
def world_file(tmp_path):
    """Has the world written before several processes read it."""
    write(tmp_path)


@pytest.mark.parametrize("mode", AutoresetMode, ids=lambda mode: mode.name)
def test_each_autoreset_mode_equals_that_of_gymnasium(tmp_path, mode):
    makers = [partial(made, tmp_path, randomization=VARIED)] * COUNT
    gymnasiums = AsyncVectorEnv if mode is AutoresetMode.NEXT_STEP else SyncVectorEnv
    ours, theirs = WorldVectorEnv(makers, 2, mode), gymnasiums(makers, autoreset_mode=mode)
    assert ours.metadata["autoreset_mode"] is mode and ours.workers == 2
    assert (ours.observation_space, ours.action_space) == (theirs.observation_space, theirs.action_space)
    assert data_equivalence(ours.reset(seed=5), theirs.reset(seed=5))
    draw, ends = np.random.default_rng(0), 0
    for _ in range(15):
        actions = draw.uniform(-1.0, 1.0, (COUNT, 1)).astype(np.float32)
        found = ours.step(actions)
        assert data_equivalence(found, theirs.step(actions))
        has_ended = found[2] | found[3]
        ends += int(has_ended.sum())
        assert ("final_obs" in found[4]) == (mode is AutoresetMode.SAME_STEP and has_ended.any())
        if mode is AutoresetMode.DISABLED and has_ended.any():
            masks = ({"reset_mask": has_ended.copy()} for _ in range(2))
            assert data_equivalence(ours.reset(options=next(masks)), theirs.reset(options=next(masks)))
    assert ends >= 2 * COUNT
    ours.close()
    theirs.close()


def test_as_many_workers_as_processors_stay_on_one_each(tmp_path):
    all_processors = os.sched_getaffinity(0)
    few = set(sorted(all_processors)[:2])
    os.sched_setaffinity(0, few)
    try:
        for workers in range(1, len(few) + 1):
            envs = WorldVectorEnv([partial(made, tmp_path)] * 2, workers)
            used = [os.sched_getaffinity(each._process.pid) for each in envs._processes]
            assert used == ([{each} for each in sorted(few)] if workers == len(few) else [few] * workers)
            envs.close()
    finally:
        os.sched_setaffinity(0, all_processors)


def test_an_episode_that_has_ended_waits_for_its_reset(tmp_path):
    envs = WorldVectorEnv([partial(made, tmp_path)], autoreset_mode=AutoresetMode.DISABLED)
    envs.reset(seed=1)
    with pytest.raises(ValueError, match="the episode has ended: expected reset"):
        for _ in range(7):
            envs.step(np.zeros((1, 1), np.float32))
    with pytest.raises(ValueError, match=r"reset_mask: expected 1 bools, one true at least, got array\(\[False\]\)"):
        envs.reset(options={"reset_mask": np.array([False])})
    with pytest.raises(ValueError, match="expected 1 actions, got 2"):
        envs.step(np.zeros((2, 1), np.float32))
    assert envs.call("render_mode") == (None,) and envs.get_attr("metadata")[0]["render_fps"] == 100
    envs.close()


def test_a_task_that_fails_in_a_worker_is_named(tmp_path):
    envs = WorldVectorEnv([partial(made, tmp_path), partial(made, tmp_path, "raise")], 2)
    envs.reset(seed=1)
    with pytest.raises(PluginError, match="gym_world:Swing failed in reward at action 1: ZeroDivisionError"):
        envs.step(np.zeros((2, 1), np.float32))
    envs.close()


def test_a_worker_that_dies_is_named(tmp_path):
    envs = WorldVectorEnv([partial(made, tmp_path)] * 2, 2)
    os.kill(envs._processes[1]._process.pid, signal.SIGKILL)
    with pytest.raises(InterfaceError, match="worker 1 has ended"):
        envs.reset(seed=1)
    envs.close()
    assert all(process._process.returncode is not None for process in envs._processes)
