"""The tasks of environments: Gymnasium's check finds nothing, scripts succeed, and success is not the reward's."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from custom_ros_tools.config import load_config
from rpbi.gym.env import WorldEnv
from rpbi_examples.gym import ENVIRONMENTS, SCENE_ENVIRONMENTS, train_reach

Action = list[float]
SHORT_SCENES = {"rpbi/DualArm-v0", "rpbi/Wiping-v0"}
"""Scenes whose environments are checked in every run; the others take longer."""


def towards(task: Any, goal: Any) -> Action:
    """Returns the way of the hand to a place."""
    return np.clip((np.array(goal) - task.hand()) / task.config.step, -1.0, 1.0).tolist()


def reach(env: WorldEnv, task: Any, memory: dict[str, Any]) -> Action:
    """Returns the change of joints by the inverse of the Jacobian."""
    arm: Any = env.world.bodies["kuka_lwr"]
    positions = list(arm.joint_positions().values())
    jacobian = arm.robot_model.jacobian(arm.base_pose(), positions, task._link)[:3]
    change = np.linalg.pinv(jacobian) @ (np.array(task.goal) - task.position())
    return np.clip(change / task._actions[0]._steps, -1.0, 1.0).tolist()


def push(env: WorldEnv, task: Any, memory: dict[str, Any]) -> Action:
    """Goes behind the box, and then straight on."""
    box, hand = np.array(task.position_of("box")[:2]), np.array(task.hand()[:2])
    way = np.array(task.goal) - box
    way /= np.linalg.norm(way)
    behind = box - 0.135 * way - hand
    memory["pushes"] = memory.get("pushes", False) or np.linalg.norm(behind) < 0.02
    aside = (hand - box) - way * (way @ (hand - box))
    step = 0.006 * way - 0.5 * aside if memory["pushes"] else behind
    return np.clip(step / task.config.step, -1.0, 1.0).tolist()


def lift(env: WorldEnv, task: Any, memory: dict[str, Any]) -> Action:
    """Opens over the box, goes down, closes, and goes up."""
    box, hand = np.array(task.position_of("box")), np.array(task.hand())
    if "closed" not in memory and np.linalg.norm(box - hand) > 0.008:
        over = np.linalg.norm((box - hand)[:2]) > 0.01
        return [*towards(task, [*box[:2], 0.12 if over else box[2]]), 1.0]
    memory["closed"] = memory.get("closed", 0) + 1
    return [0.0, 0.0, 1.0 if memory["closed"] > 12 else 0.0, -1.0]


def wipe(env: WorldEnv, task: Any, memory: dict[str, Any]) -> Action:
    """Presses, and goes to the nearest cell that is left."""
    hand = np.array(task.hand())
    left = task.cells[~task.is_wiped]
    cell = left[np.argmin(np.linalg.norm(left - hand[:2], axis=1))]
    return towards(task, [*cell, hand[2] + (-0.01 if task.force() < 5.0 else 0.001)])


def peg(env: WorldEnv, task: Any, memory: dict[str, Any]) -> Action:
    """Goes over the hole, and then down."""
    x, y, z = task.hole
    is_over = np.hypot(task.hand()[0] - x, task.hand()[1] - y) < 0.003
    return towards(task, (x, y, z - 0.05 if is_over or task.hand()[2] < z + 0.015 else z + 0.03))


SCRIPTS: dict[str, Callable[[WorldEnv, Any, dict[str, Any]], Action]] = {
    each.__name__: each for each in (reach, push, lift, wipe, peg)
}


@pytest.fixture(scope="module", params=ENVIRONMENTS)
def env(request):
    env = gymnasium.make(request.param).unwrapped
    yield env
    env.close()


def run(env: WorldEnv, act: Callable[[WorldEnv, Any, dict[str, Any]], Action]) -> bool:
    """Runs an episode, and returns whether it succeeded."""
    memory: dict[str, Any] = {}
    has_ended = False
    while not has_ended:
        action = np.array(act(env, env.task, memory), np.float32)
        *_, terminated, truncated, info = env.step(action)
        has_ended = terminated or truncated
    return bool(info["is_success"])


def check(env: WorldEnv) -> None:
    """Has Gymnasium check an environment; a warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env, skip_render_check=True)  # it opens a window, see tests/gui


@pytest.mark.quick
def test_gymnasium_finds_nothing_to_complain_about(env):
    check(env)


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_nor_with_images_and_random_variation(name):
    robot = "panda" if "Lift" in name else "kuka_lwr"
    varied = {
        "joints": [{"robot": robot, "offset": 0.01}],
        "cameras": [{"camera": "camera", "position": [0.05, 0.05, 0.05], "rotation": 0.05}],
        "delays": {"observation_s": [0.0, 0.04], "action_s": [0.0, 0.02]},
    }
    env = gymnasium.make(name, cameras=["camera"], render_mode="rgb_array", randomization=varied).unwrapped
    check(env)
    image = env.render()
    assert image.shape == (240, 320, 3) and image.std() > 10.0
    env.close()


@pytest.mark.parametrize(
    "name",
    [name if name in SHORT_SCENES else pytest.param(name, marks=pytest.mark.thorough) for name in SCENE_ENVIRONMENTS],
)
def test_nor_in_scenes_whose_robots_move(name):
    env = gymnasium.make(name).unwrapped
    check(env)
    before, _ = env.reset(seed=1)
    for _ in range(10):
        after, *_ = env.step(np.ones(env.action_space.shape, np.float32))
    for robot in env.task._kind.watch.robots:
        assert np.abs(after[f"{robot}/joints"] - before[f"{robot}/joints"]).max() > 0.003
    assert env.task.max_actions * env.task.period_s == pytest.approx(env.task._kind.longest_s, abs=0.02)
    env.close()


def test_a_script_succeeds_and_standing_still_does_not(env):
    script = SCRIPTS[ENVIRONMENTS[env.spec.id]]
    for seed in (1, 2):
        env.reset(seed=seed)
        assert run(env, script)
    env.reset(seed=1)
    assert not run(env, lambda env, task, memory: [0.0] * env.action_space.shape[0])


def test_success_is_not_the_rewards(env, monkeypatch):
    """A reward that promises everything changes nothing."""
    monkeypatch.setattr(env.task, "reward", lambda: 1e6)
    env.reset(seed=1)
    *_, info = env.step(np.zeros(env.action_space.shape, np.float32))
    assert not info["is_success"]


@pytest.mark.thorough
def test_reaching_is_learned(monkeypatch):
    monkeypatch.setattr(train_reach, "TESTS", 8)
    task = {**load_config("{rpbi_examples}/configs/gym/reach/task.yaml"), "max_actions": 25}
    envs = gymnasium.make_vec(train_reach.ENVIRONMENT, num_envs=8, vectorization_mode="sync", task=task)
    first, *_, last = train_reach.train(envs, generations=4, tries=1, seed=1)
    envs.close()
    assert last.score > first.score + 1.5 and last.success > first.success
