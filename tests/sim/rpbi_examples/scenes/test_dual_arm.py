"""Two arms carry a box by pressing on it; that it arrives is tested with the launch file."""

from __future__ import annotations

import numpy as np
import pytest
from scene_policies import imitate

from rpbi_examples.scenes import dual_arm
from rpbi_examples.scenes.task import make_env, run_episode


@pytest.fixture(scope="module")
def env():
    found = make_env("dual_arm")
    yield found
    found.close()


@pytest.mark.thorough
def test_a_policy_that_moves_both_hands_succeeds(env):
    *_, (observation, _, has_ended, _, info) = imitate(env, 3)
    scene = env.task.scene
    assert has_ended and info["is_success"] and scene.figures()["error [mm]"] < 5.0
    assert observation["goal"] == pytest.approx((*scene.goal.position, *scene.goal.quat_xyzw))


@pytest.mark.thorough
def test_without_pressing_the_box_stays(env, monkeypatch):
    monkeypatch.setattr(dual_arm, "FORCE_N", 2.0)
    result = run_episode(env, 2)
    assert not result.success and result.figures["error [mm]"] > 20.0
    assert result.reason.startswith("the box slipped: it is ")


def test_noise_is_sensed_deterministically_and_not_judged():
    env = make_env("dual_arm", noise=True)
    sensed = []
    for _ in range(2):
        env.task.seed = 7
        env.reset(seed=7)
        for _ in range(30):
            env.step(None)
        scene = env.task.scene
        sensed.append(scene.sensed.poses["box"])
        off_mm = 1e3 * np.linalg.norm(np.subtract(sensed[-1].position, scene.seen.poses["box"].position))
        assert 0.01 < off_mm < 3.0, "smoothed, since it rests"
        assert scene.seen.poses["box"] == env.world.bodies["box"].base_pose()
    assert sensed[0] == sensed[1]
    env.close()
