"""Policies for scenes as tasks of Gymnasium: one at random, and one that does what the scene itself would do."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from robot_model.geometry import minus, rotation_between
from rpbi.gym.actions import PoseAction
from rpbi.gym.env import WorldEnv
from rpbi_examples.scenes.scene import InputValue


def act_at_random(env: WorldEnv, steps: int) -> Any:
    """Acts some times in a new episode; returns what the last `step` returned."""
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    env.action_space.seed(1)
    for _ in range(steps):
        found = env.step(env.action_space.sample())
        assert env.observation_space.contains(found[0])
    return found


def imitate(env: WorldEnv, seed: int) -> Iterator[Any]:
    """Yields what `step` returns, up to the end of an episode in which actions follow the targets of the scene."""
    task: Any = env.task
    task.seed = seed
    env.reset(seed=seed)
    twin = type(task.scene)(np.random.default_rng(seed))
    twin.prepare()
    twin.take_changes()
    twin.look(task.scene.seen)
    acts = twin.act()
    goals: dict[str, Any] = {}
    while True:
        next(acts, None)
        for slot, value in (change for change in twin.take_changes() if isinstance(change, InputValue)):
            goals[slot] = {**goals.get(slot, {}), **value} if isinstance(value, dict) else value
        action = [_towards(part, goals.get(part._slot)) for part in task._actions]
        found = env.step(np.concatenate(action, dtype=np.float32))
        yield found
        if found[2] or twin.seen.time_s > twin.longest_s:
            return
        twin.look(task.scene.seen)


def _towards(part: Any, goal: Any) -> np.ndarray:
    """Returns the numbers by which a part of an action comes nearer to a target."""
    if goal is None:
        return np.zeros(part.size)
    if isinstance(part, PoseAction):
        way, turn = minus(goal.position, part.goal.position), rotation_between(part.goal.quat_xyzw, goal.quat_xyzw)
        return np.clip((*np.array(way) / part._step, *np.array(turn) / part._turn), -1.0, 1.0)
    wanted = [goal.get(name, at) for name, at in zip(part._names, part._targets)]
    return np.clip((wanted - part._targets) / part._steps, -1.0, 1.0)
