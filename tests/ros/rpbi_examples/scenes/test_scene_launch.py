"""Launch files of scenes: what they do is what `./rpbi score` does with the same seed."""

from __future__ import annotations

import re

import pytest
from ros_system import wait_until

from rpbi_examples.scenes import SCENES
from rpbi_examples.scenes.task import make_env, run_episode

ENDED = re.compile(r"seed (\d+) (\w+), after ([^;]*); (.*), real-time factor.* state: (\w+)")
BOUNDS = {
    "cup": {"off [mm]": (0.0, 5.0), "largest tilt [deg]": (0.0, 5.0)},
    "wiping": {
        "way within 10 % [%]": (95.0, 100.0),
        "stains gone [%]": (100.0, 100.0),
        "coverage [%]": (99.0, 100.0),
        "mean force [N]": (17.44, 17.79),  # within 1 % of the 17.62 N of the seed
    },
    "handover": {"held by the robot alone [s]": (5.0, 20.0), "largest force on the person [N]": (1.0, 20.0)},
    "talos": {"hand error [mm]": (0.0, 10.0), "largest lean [deg]": (1.0, 10.0), "feet slip [mm]": (0.0, 5.0)},
    "factory": {"parts placed": (6.0, 6.0), "smallest distance of the arms [mm]": (50.0, 500.0)},
}
"""Least and largest value of some figures."""


def _ends(ros, *arguments):
    """Launches a scene and returns seed, verdict, time, figures and state hash of each episode, once all have ended."""
    process = ros.start(["roslaunch", "rpbi_examples", *arguments, "headless:=true", "real_time_factor:=0"])
    wait_until(lambda: process.poll() is not None, "all episodes have ended", 240.0)
    return ENDED.findall(ros.output(process))


def test_an_episode_ends_as_in_the_score(ros):
    ends = _ends(ros, "dual_arm.launch", "seed:=4", "episodes:=1")
    env = make_env("dual_arm")
    result = run_episode(env, 4)
    assert result.success, result
    figures = result.figures
    assert figures["error [mm]"] < 5.0 and figures["largest tilt [deg]"] < 1.0
    assert 70.0 < figures["force from [N]"] < figures["to [N]"] < 95.0
    assert 25.0 < figures["left carries [%]"] < 75.0
    assert [(seed, verdict, state) for seed, verdict, _, _, state in ends] == [
        ("4", "succeeded", env.world.state_hash())
    ]
    env.close()


@pytest.mark.parametrize("scene", BOUNDS)
def test_a_scene_does_what_it_is_about(ros, scene):
    ((seed, verdict, _, figures, _),) = _ends(ros, f"{scene}.launch", "seed:=2", "episodes:=1")
    assert (seed, verdict) == ("2", "succeeded")
    found = dict(each.rsplit(": ", 1) for each in figures.split(", "))
    for name, (low, high) in BOUNDS[scene].items():
        assert low <= float(found[name]) <= high, f"{name}: {found[name]}"


def test_all_scenes_are_launched():
    assert BOUNDS.keys() | {"dual_arm"} == SCENES.keys()
