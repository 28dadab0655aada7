"""Two arms carry a box: it arrives, does not tilt, and both press and carry."""

from __future__ import annotations

import pytest

from rpbi_examples.scenes import dual_arm
from rpbi_examples.scenes.task import make_env, run_episode


@pytest.fixture(scope="module")
def env():
    found = make_env("dual_arm")
    yield found
    found.close()


@pytest.mark.parametrize("seed", [2, 3])
def test_the_box_is_carried_to_its_goal(env, seed):
    result = run_episode(env, seed)
    assert result.success, result
    figures = result.figures
    assert figures["error [mm]"] < 5.0 and figures["largest tilt [deg]"] < 1.0
    assert 70.0 < figures["force from [N]"] < figures["to [N]"] < 95.0
    assert 25.0 < figures["left carries [%]"] < 75.0


def test_without_pressing_the_box_stays(env, monkeypatch):
    monkeypatch.setattr(dual_arm, "FORCE_N", 2.0)
    result = run_episode(env, 2)
    assert not result.success and result.figures["error [mm]"] > 20.0
