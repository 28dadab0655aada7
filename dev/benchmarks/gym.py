"""Steps of environments per second, compared with PyBullet and the renderer alone; effects of resets and workers.

Times of one process are those of its processor, since others may have it meanwhile. Two workers need two processors to
themselves.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import gymnasium
import numpy as np
from result import Result, Target

from rpbi.gym.env import WorldEnv
from rpbi.images import CameraImages
from rpbi.render.frame import Camera
from rpbi_examples.gym import ENVIRONMENTS

ACTIONS = 50
"""Actions of an episode."""
EPISODES, QUICK_EPISODES = 20, 4
ENVS = 8
"""Environments of a vector."""
VECTOR_STEPS, QUICK_VECTOR_STEPS = 100, 15
RESETS = 20
WORKER_GAIN = 1.8
PANDA_GYM = "PandaReach-v3"
"""Has 20 ticks of 2 ms an action; `.venv/bin/pip install --no-deps panda-gym==3.0.7` adds it."""

Call = tuple[tuple[Any, ...], dict[str, Any]]


def run(quick: bool) -> list[Result]:
    """Measures all tasks, and vectors, cameras and resets with the task reach."""
    episodes = QUICK_EPISODES if quick else EPISODES
    reach = next(iter(ENVIRONMENTS))
    return [
        *(_steps(name, episodes) for name in ENVIRONMENTS),
        _images(reach, episodes),
        *_resets(reach),
        *_workers(reach, QUICK_VECTOR_STEPS if quick else VECTOR_STEPS, episodes),
    ]


def _steps(name: str, episodes: int) -> Result:
    """Compares an environment with the same calls of PyBullet without it, episode by episode."""
    env = _made(name)
    speeds, floors = [], []
    for seed in range(episodes):
        actions = np.random.default_rng(seed).uniform(-1.0, 1.0, (ACTIONS, *env.action_space.shape))
        calls = list(_motor_calls(env, seed, actions))
        env.reset(seed=seed)
        speeds.append(ACTIONS / _duration(partial(_act, env, actions)))
        end = _motion(env)
        env.reset(seed=seed)
        floors.append(ACTIONS / _duration(partial(_simulate, env, calls)))
        assert _motion(env) == end, f"{name}: PyBullet alone gives a different motion"
    env.close()
    value, floor = statistics.median(speeds), statistics.median(floors)
    return Result("gym", f"{name}: actions a second", value, "1/s", floor, Target(0.8, at_least=True, of_floor=True))


def _motor_calls(env: WorldEnv, seed: int, actions: Any) -> Iterator[list[Call]]:
    """Runs an episode, and yields the arguments of all calls that set a motor, for each action."""
    env.reset(seed=seed)
    pb, calls = env.world.pb, []
    original = pb.setJointMotorControl2

    def noted(*arguments: Any, **options: Any) -> None:
        calls.append((arguments, options))
        original(*arguments, **options)

    pb.setJointMotorControl2 = noted
    for action in actions:
        env.step(action)
        yield calls.copy()
        calls.clear()
    pb.setJointMotorControl2 = original


def _act(env: WorldEnv, actions: Any) -> None:
    for action in actions:
        env.step(action)


def _simulate(env: WorldEnv, calls: list[list[Call]]) -> None:
    """Simulates an episode with PyBullet alone: sets motors, steps, and reads the joints once for each action."""
    pb, robot = env.world.pb, env.world.bodies[env.task.config.robot]
    step, ticks = pb.stepSimulation, range(env.task.config.action_ticks)
    for each in calls:
        for arguments, options in each:
            pb.setJointMotorControl2(*arguments, **options)
        for _ in ticks:
            step()
        pb.getJointStates(robot.body_id, robot.joint_indices)


def _motion(env: WorldEnv) -> list[tuple[float, ...]]:
    return [body.motion_state() for body in env.world.bodies.values()]


def _images(name: str, episodes: int) -> Result:
    """Compares actions with an image in each observation with the renderer, which draws the same scenes alone."""
    env = _made(name, cameras=("camera",))
    speeds, floors = [], []
    for seed in range(episodes):
        env.reset(seed=seed)
        actions = np.random.default_rng(seed).uniform(-1.0, 1.0, (ACTIONS, *env.action_space.shape))
        speeds.append(ACTIONS / _duration(partial(_act, env, actions)))
        floors.append(ACTIONS / _duration(partial(_draw, env)))
    env.close()
    value, floor = statistics.median(speeds), statistics.median(floors)
    figure = f"{name} with a camera: actions a second"
    return Result("gym", figure, value, "1/s", floor, Target(0.85, at_least=True, of_floor=True))


def _draw(env: WorldEnv) -> None:
    """Draws the scene once for each action, by the renderer of the environment."""
    images: CameraImages = env._views._images
    camera = next(iter(env.world.cameras.values()))
    intrinsics = Camera.of(camera.config).intrinsics
    for _ in range(ACTIONS):
        images.renderer.draw(intrinsics, camera.pose)


def _resets(name: str) -> Iterator[Result]:
    """Compares resets that keep the bodies with those that load them again."""
    env = _made(name)
    durations = []
    for rebuild in (False, True):
        total_s = 0.0
        for _ in range(RESETS):
            env.step(env.action_space.sample())
            total_s += _duration(partial(env.world.reset, rebuild))
        durations.append(total_s / RESETS)
        env.reset()
    env.close()
    yield Result(
        "gym", f"{name}: reset, beside one that loads everything", 1e3 * durations[0], "ms", 1e3 * durations[1]
    )


def _workers(name: str, steps: int, rounds: int) -> Iterator[Result]:
    """Compares two workers with one, in turns; and two processes of panda-gym, where it is installed."""
    ours = {f"{count} workers": gymnasium.make_vec(name, num_envs=ENVS, workers=count) for count in (1, 2)}
    theirs = {}
    if find_spec("panda_gym"):
        import_module("panda_gym")
        theirs = {f"{count} panda-gym": gymnasium.make_vec(PANDA_GYM, count, "async") for count in (1, 2)}
    speeds = _speeds(ours | theirs, steps, rounds)
    target = Target(WORKER_GAIN, at_least=True, of_floor=True)
    figure = f"{ENVS} x {name}, two workers beside one: actions a second"
    yield Result("gym", figure, speeds["2 workers"], "1/s", speeds["1 workers"], target)
    if theirs:
        figure = f"{PANDA_GYM} of panda-gym, two processes beside one: actions a second"
        yield Result("gym", figure, speeds["2 panda-gym"], "1/s", speeds["1 panda-gym"])


def _speeds(envs: dict[str, Any], steps: int, rounds: int) -> dict[str, float]:
    """Returns the actions per second of vectors, measured alternately, and closes them."""
    speeds: dict[str, list[float]] = {name: [] for name in envs}
    for each in envs.values():
        each.reset(seed=0)
    for _ in range(rounds):
        for name, each in envs.items():
            actions = [each.action_space.sample() for _ in range(steps)]
            begin_s = time.perf_counter()
            for action in actions:
                each.step(action)
            speeds[name].append(each.num_envs * steps / (time.perf_counter() - begin_s))
    for each in envs.values():
        each.close()
    return {name: statistics.median(found) for name, found in speeds.items()}


def _made(name: str, **options: Any) -> WorldEnv:
    env = gymnasium.make(name, disable_env_checker=True, **options).unwrapped
    assert isinstance(env, WorldEnv)
    env.reset(seed=0)
    env.reset(seed=0)
    return env


def _duration(call: Callable[[], object]) -> float:
    """Returns the time of this thread on a processor [s]."""
    begin_s = time.thread_time()
    call()
    return time.thread_time() - begin_s
