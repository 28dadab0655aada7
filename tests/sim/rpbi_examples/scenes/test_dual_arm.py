"""Two arms carry a box by pressing on it; that it arrives is tested with the launch file."""

from __future__ import annotations

import pytest
from scene_policies import imitate

from rpbi_examples.scenes import dual_arm
from rpbi_examples.scenes.task import make_env, run_episode


@pytest.fixture(scope="module")
def env():
    found = make_env("dual_arm")
    yield found
    found.close()


def test_a_policy_that_moves_both_hands_succeeds(env):
    *_, (observation, _, has_ended, _, info) = imitate(env, 3)
    scene = env.task.scene
    assert has_ended and info["is_success"] and scene.figures()["error [mm]"] < 5.0
    assert observation["goal"] == pytest.approx((*scene.goal.position, *scene.goal.quat_xyzw))


def test_without_pressing_the_box_stays(env, monkeypatch):
    monkeypatch.setattr(dual_arm, "FORCE_N", 2.0)
    result = run_episode(env, 2)
    assert not result.success and result.figures["error [mm]"] > 20.0
    assert result.reason.startswith("the box slipped: it is ")
