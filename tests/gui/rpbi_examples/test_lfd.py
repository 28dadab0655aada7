"""`lfd.launch` as a person uses it: real keys in a window show how to push a box, and the arm repeats it."""

from __future__ import annotations

import json

import pandas as pd
import pytest
from PIL import Image
from ros_system import RPBI, RosSystem, wait_until
from std_srvs.srv import Trigger

from rpbi_data import EpisodeFolder, bag_to_dataframes

SLOW = "real_time_factor:=0.5"
"""Half as fast, since a person cannot push straight where other tests take the processor."""
GOAL = "goal:=-0.73 0"
"""Straight ahead, so that one push does it; `./rpbi bench lfd` has the goal round the corner."""
SLOW_S = 400.0


@pytest.fixture(scope="module")
def session(ros_master, screen, tmp_path_factory):
    """The session's process after its end, its output, and the folder of its results."""
    system = RosSystem(tmp_path_factory.mktemp("lfd"))
    try:
        out = system.folder / "out"
        arguments = ["operator:=keyboard", "seed:=5", "rounds:=1", "headless:=true", f"out:={out}", SLOW, GOAL]
        launch = system.start([RPBI, "launch", "lfd", *arguments], **screen.environment)
        wait_until(lambda: "key 1: home" in system.output(launch), "it is ready", SLOW_S)
        assert system.call("/lfd/learn", Trigger).success  # nothing was shown yet
        wait_until(lambda: "learn: there is no demonstration yet: press 2" in system.output(launch), "it says so")
        person = ["rosrun", "rpbi_examples", "lfd_person.py", "_window:=true", "_seed:=5"]
        system.start(person, **screen.environment)
        wait_until(lambda: launch.poll() is not None, "it ends after an execution", SLOW_S)
        yield launch, system.output(launch), out
    finally:
        system.close()


@pytest.mark.thorough
def test_the_box_is_at_its_goal_after_the_execution(session):
    launch, output, out = session
    summary = json.loads((out / "summary.json").read_text())
    (executed,) = summary["executions"]
    assert executed["at_goal"] and launch.returncode == 0, output
    assert executed["box_error_m"] < 0.03 and executed["box_error_deg"] < 10.0
    assert max(map(abs, executed["start"])) > 0.02, "it began somewhere else"
    assert "box/yaw" in output, "the demonstration is shown as a table"


@pytest.mark.thorough
def test_demonstration_and_execution_are_episodes_and_tables(session):
    *_, out = session
    folder = EpisodeFolder(out / "episodes")
    episodes = {each.number: each for each in folder.all()}
    assert [episodes[number].label for number in sorted(episodes)][-2:] == ["success", "success"]
    assert all(each.state == "complete" for each in episodes.values())
    first = min(episodes)
    joy = bag_to_dataframes(folder.folder_of(first) / "episode.bag", "/joy")["/joy"]
    assert (joy["axes/1"] == 1.0).any(), "a key was held"
    for number in episodes:
        table = pd.read_parquet(out / f"tables/episode_{number:06d}.parquet", engine="fastparquet")
        assert {"tip/x", "tip/y", "box/x", "box/y", "box/yaw", "contact", "signal/x", "signal/y"} == set(table.columns)
        assert table["contact"].max() > 0.0
        assert len(pd.read_csv(out / f"tables/episode_{number:06d}.csv")) == len(table)


@pytest.mark.thorough
def test_pictures_are_drawn(session):
    for name in ("paths", "pipeline"):
        with Image.open(session[-1] / f"{name}.png") as picture:
            assert len(picture.convert("RGB").getcolors(1 << 24)) > 100
