"""A Talos stands by torques; what it cannot do ends its episode. What it can is tested with the launch file."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("pinocchio")
pytest.importorskip("daqp")

from scene_policies import act_at_random

from rpbi_examples.balance.largest_push import stands
from rpbi_examples.scenes.scene import run_scene
from rpbi_examples.scenes.talos import HAND
from rpbi_examples.scenes.task import EnvStage, make_env


@pytest.fixture(scope="module")
def env():
    found = make_env("talos")
    yield found
    found.close()


def begin(env, seed: int):
    env.task.seed = seed
    env.reset(seed=seed)
    return env.task.scene


@pytest.mark.thorough
def test_a_push_beyond_its_strength_throws_it_over(env):
    assert not stands(env, 2, math.pi, 120.0)
    assert env.world.bodies["talos"].base_pose().position[2] < 0.8


@pytest.mark.thorough
def test_target_out_of_reach_is_reported(env):
    scene = begin(env, 2)
    x, y, z = scene.target.position
    scene.target = scene.target._replace(position=(x + 1.0, y, z))
    result = run_scene(scene, EnvStage(env))
    assert not result.success and "the hand does not reach the ball" in result.reason
    assert env.world.bodies["talos"].base_pose().position[2] > 0.82  # it stands all the same
    assert result.figures["largest lean [deg]"] < 20.0 and result.figures["feet slip [mm]"] < 2.0
    efforts = env.world.bodies["talos"].motors.applied_efforts
    assert len(efforts) == 32 and max(map(abs, efforts.values())) > 20.0  # torques hold it, not motors


@pytest.mark.parametrize("noise", [False, True])
def test_success_is_judged_over_the_whole_episode(noise, monkeypatch):
    """A hand on the floor, or a lean, for one cycle in the middle is a failure at the end."""
    env = make_env("talos", noise=noise)
    scene, stage = begin(env, 3), EnvStage(env)
    stage.cycle()
    act = scene.act()
    for _ in range(60):
        next(act)
        for change in scene.take_changes():
            stage.do(change)
        stage.cycle()
    monkeypatch.setattr(scene, "_has_stayed", True)
    assert scene.has_succeeded(), "it stands"
    assert (scene.sensed.poses["ball"] != scene.target) == noise
    upright, on_feet = scene.seen, scene.seen.contacts["floor"]
    on_hand = on_feet[0]._replace(other_link="arm_left_7_link")
    scene.look(upright._replace(contacts={"floor": (*on_feet, on_hand)}))
    scene.look(upright)
    assert not scene.has_succeeded()
    env.close()


def test_a_policy_moves_the_hand_while_the_controller_balances(env):
    observation, *_ = act_at_random(env, 25)
    scene = env.task.scene
    assert env.action_space.shape == (6,) and tuple(observation["goal"]) == pytest.approx(scene.target.position)
    ball, robot = (env.world.bodies[name].base_pose().position for name in ("ball", "talos"))
    assert ball == pytest.approx(scene.target.position) and robot[2] > 0.95
    hand = scene.pose(HAND).position
    for _ in range(25):
        env.step([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    assert scene.pose(HAND).position[1] - hand[1] > 0.03
