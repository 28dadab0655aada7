"""Launch files of scenes: what they do is what `./rpbi score` does with the same seed."""

from __future__ import annotations

import re

import pytest
from ros_system import wait_until

from rpbi_examples.scenes.task import make_env, run_episode

ENDED = re.compile(r"seed (\d+) (\w+) after .*; state (\w+)")


def _ends(ros, *arguments):
    """Launches a scene and returns seed, verdict and state hash of each episode, once all have ended."""
    process = ros.start(["roslaunch", "rpbi_examples", *arguments, "headless:=true", "real_time_factor:=0"])
    wait_until(lambda: process.poll() is not None, "all episodes have ended", 240.0)
    return ENDED.findall(ros.output(process))


@pytest.mark.parametrize("scene", ["dual_arm"])
def test_an_episode_ends_as_in_the_score(ros, scene):
    ends = _ends(ros, f"{scene}.launch", "seed:=4", "episodes:=1")
    env = make_env(scene)
    result = run_episode(env, 4)
    assert result.success
    assert ends == [("4", "succeeded", env.world.state_hash())]
    env.close()
