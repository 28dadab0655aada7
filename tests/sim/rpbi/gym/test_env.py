"""Environments: spaces, seeds, delays, images, and tasks that fail."""

from __future__ import annotations

import warnings

import gymnasium
import numpy as np
import pytest
from gym_world import Swing, made, write
from gymnasium.utils.env_checker import check_env, data_equivalence

from custom_ros_tools.errors import ConfigError, PluginError, UnknownNameError
from rpbi.gym.env import WorldEnv, register

VARIED = {
    "dynamics": [{"object": "box", "mass_factor": [0.5, 2.0], "lateralFriction": [0.2, 0.8]}],
    "poses": [{"object": "box", "position": [0.02, 0.02, 0.0], "yaw": 0.5}],
    "joints": [{"robot": "arm", "offset": 0.1}],
    "cameras": [{"camera": "eye", "position": [0.05, 0.05, 0.05], "rotation": 0.1}],
    "delays": {"observation_s": [0.0, 0.02], "action_s": [0.0, 0.02]},
}


def episode(env: WorldEnv, seed: int | None) -> list:
    """Runs an episode, and returns all that it returns, with the hash at its end."""
    found: list = [env.reset(seed=seed)]
    while not found or len(found[-1]) == 2 or not (found[-1][2] or found[-1][3]):
        found.append(env.step(np.array([0.9], np.float32)))
    return [*found, env.unwrapped.world.state_hash()]


@pytest.mark.parametrize(
    "options",
    [{}, {"randomization": VARIED, "cameras": ["eye"], "render_mode": "rgb_array"}],
    ids=["plain", "varied, with images"],
)
def test_gymnasium_finds_nothing_to_complain_about(tmp_path, options):
    name = f"test/Swing{len(options)}-v0"
    register(name, write(tmp_path), "gym_world:Swing", **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(name)
        check_env(env.unwrapped, skip_render_check=True)  # which opens a window, see tests/gui
    assert env.unwrapped.world.bodies.keys() == {"floor", "box", "arm"}
    env.reset()
    image = env.render() if options else np.zeros((16, 24, 3), np.uint8)
    assert (image.shape, image.dtype) == ((16, 24, 3), np.uint8) and (image.max() > 0) == bool(options)
    env.close()


def test_seeds_decide_on_everything(tmp_path):
    env = made(tmp_path, randomization=VARIED, cameras=["eye"])
    first, other = episode(env, 1), episode(env, 2)
    following = episode(env, None)
    assert not data_equivalence(first[0], other[0])
    env.world.reset()  # the next one begins from bodies that are loaded again
    env.world.act("box", "push", {"force": [1.0, 0.0, 0.0]})
    assert data_equivalence(episode(env, 1), first)
    assert data_equivalence(episode(env, 2), other) and data_equivalence(episode(env, None), following)
    again = made(tmp_path, randomization=VARIED, cameras=["eye"])
    assert data_equivalence(episode(again, 1), first)
    env.close()
    again.close()


def test_variation_stays_within_the_configured_ranges(tmp_path):
    env = made(tmp_path, randomization=VARIED)
    masses, places, delays = [], [], set()
    for seed in range(20):
        observation, _ = env.reset(seed=seed)
        masses.append(env.world.dynamics("box").mass)
        places.append(observation["box/pose"][0])
        delays.add(env._line._action_ticks)
    env.close()
    assert 0.5 <= min(masses) < 0.9 < 1.4 < max(masses) <= 2.0
    assert 0.33 <= min(places) < 0.345 < 0.355 < max(places) <= 0.37
    assert delays > {0, 20} or len(delays) > 5


RANGES = {
    "lateralFriction": (0.2, 0.8),
    "spinningFriction": (0.01, 0.05),
    "rollingFriction": (0.001, 0.02),
    "restitution": (0.1, 0.6),
    "linearDamping": (0.0, 0.3),
    "angularDamping": (0.1, 0.4),
    "jointDamping": (0.5, 2.0),
    "joint": (-0.1, 0.1),
    "camera": (-0.05, 0.05),
    "camera_turn": (0.0, 0.2),
}
"""What varies, by ranges."""


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """Values of 20 episodes by what varies, as the world has them, or as commands had them where it does not show."""
    keys = [key for key in RANGES if key not in ("jointDamping", "joint", "camera", "camera_turn")]
    varied = {
        "dynamics": [
            {"object": "box", **{key: list(RANGES[key]) for key in keys}},
            {"object": "arm/bar", "jointDamping": list(RANGES["jointDamping"])},
        ],
        "joints": [{"robot": "arm", "offset": 0.1, "joints": ["swing"]}],
        "cameras": [{"camera": "eye", "position": [0.05, 0.0, 0.0], "rotation": 0.2}],
    }
    env = made(tmp_path_factory.mktemp("varied"), randomization=varied)
    place = env.world.cameras["eye"].pose
    found = {key: [] for key in RANGES}
    for seed in range(20):
        env.reset(seed=seed)
        changes = [each.value for each in env.world.commands.since(0)[1] if each.what == "dynamics"]
        for key in ("linearDamping", "angularDamping", "jointDamping"):
            found[key] += [value for change in changes if (value := getattr(change, key)) is not None]
        box = env.world.dynamics("box")
        found["lateralFriction"].append(box.lateral_friction)
        found["spinningFriction"].append(box.spinning_friction)
        found["rollingFriction"].append(box.rolling_friction)
        found["restitution"].append(box.restitution)
        found["joint"] += env.world.bodies["arm"].joint_positions().values()
        env.world.apply_inputs()
        way = place.inverse() @ env.world.cameras["eye"].pose
        found["camera"].append(env.world.cameras["eye"].pose.position[0] - place.position[0])
        found["camera_turn"].append(2.0 * np.arccos(min(abs(way.quat_xyzw[3]), 1.0)))
    env.close()
    return found


@pytest.mark.parametrize("what", RANGES)
def test_values_are_in_their_whole_ranges(drawn, what):
    low, high = RANGES[what]
    values = drawn[what]
    assert len(values) == 20 and low <= min(values) and max(values) <= high
    assert min(values) < low + 0.3 * (high - low) and max(values) > high - 0.3 * (high - low)


def test_delays_show_in_observations(tmp_path):
    at_once, late = (made(tmp_path, randomization={"delays": {"observation_s": [s, s]}}) for s in (0.0, 0.02))
    now, then = episode(at_once, 1), episode(late, 1)
    for (new, *_), (old, *_) in zip(now[:-2], then[2:-1]):  # two actions of 10 ticks
        assert data_equivalence(new, old)
    assert now[-1] == then[-1], "the world goes the same way"
    at_once.close()
    late.close()


def test_forces_of_sensors_are_observed(tmp_path):
    env = made(tmp_path, robot={"enabled_joint_force_torque_sensors": [{"joint": "swing", "hz": 100}]})
    observation = episode(env, 1)[-2][0]
    env.close()
    force = observation["arm/swing/wrench"][2]
    assert force == pytest.approx(-9.81, abs=1.0) or force == pytest.approx(9.81, abs=1.0), "the weight of the bar"


@pytest.mark.parametrize(
    ("fault", "method", "message"),
    [
        ("raise", "reward at action 1", "ZeroDivisionError: division by zero ("),
        ("reward", "reward at action 1", "ValueError: expected a finite number, got nan"),
        ("nan", "observation at action 0", "observation['arm/joints']: expected finite numbers, got [nan nan]"),
        ("shape", "observation at action 0", "observation['box/pose']: expected the shape (7,), got (3,)"),
        ("key", "observation at action 0", "observation: expected a dict of ['arm/joints', 'box/pose'], got"),
        ("success", "has_succeeded at action 0", "TypeError: expected True or False, got 'yes'"),
    ],
)
def test_a_task_that_fails_is_named(tmp_path, fault, method, message):
    env = made(tmp_path, fault)
    with pytest.raises(PluginError) as caught:
        env.reset(seed=0)
        env.step(np.zeros(1, np.float32))
    env.close()
    assert str(caught.value).startswith(f"gym_world:Swing failed in {method}: ") and message in str(caught.value)


@pytest.mark.parametrize(
    ("task", "randomization", "error", "message"),
    [
        ("lifft", None, UnknownNameError, "unknown task 'lifft'.*did you mean 'lift'"),
        (
            {"type": "gym_world:Swinge"},
            None,
            ConfigError,
            "task: type: 'gym_world' has no 'Swinge'; did you mean 'Swing'",
        ),
        ({"type": "gym_world:Swing", "ticks": 1}, None, ConfigError, "task: ticks: unknown key"),
        (
            {"type": "reach", "robot": "arn", "link": "bar", "goal_low": [0, 0, 0], "goal_high": [1, 1, 1]},
            None,
            ConfigError,
            "unknown robot 'arn'",
        ),
        (Swing, {"dynamics": [{"object": "bax", "mass": [1, 2]}]}, ConfigError, r"dynamics\[0\]: unknown object 'bax'"),
        (
            Swing,
            {"dynamics": [{"object": "floor", "mass": [1, 2]}]},
            ConfigError,
            r"dynamics\[0\]: mass: 'floor' is static",
        ),
        (Swing, {"cameras": [{"camera": "ear"}]}, ConfigError, r"cameras\[0\].camera: expected one of eye; got 'ear'"),
    ],
)
def test_mistakes_are_found_when_it_is_made(tmp_path, task, randomization, error, message):
    with pytest.raises(error, match=message):
        WorldEnv(write(tmp_path), task, randomization=randomization)
