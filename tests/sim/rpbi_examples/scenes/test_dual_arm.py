"""Two arms carry a box by pressing on it; that it arrives is tested with the launch file."""

from __future__ import annotations

from rpbi_examples.scenes import dual_arm
from rpbi_examples.scenes.task import make_env, run_episode


def test_without_pressing_the_box_stays(monkeypatch):
    monkeypatch.setattr(dual_arm, "FORCE_N", 2.0)
    env = make_env("dual_arm")
    result = run_episode(env, 2)
    env.close()
    assert not result.success and result.figures["error [mm]"] > 20.0
