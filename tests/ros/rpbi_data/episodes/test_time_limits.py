"""Episodes of others that need much processor time are ended by `verify` and `view`."""

from __future__ import annotations

from pathlib import Path

import pytest
from worlds import FLOOR, box, write_world

from rpbi.world.loading import load_world
from rpbi_data.episodes.bags import measure_topics
from rpbi_data.episodes.folder import BAG, EpisodeFolder
from rpbi_data.farm.ros.bag import EpisodeBag
from rpbi_data.farm.ros.maker import new_world
from rpbi_data.view import bag_messages as view

TOO_SLOW = "expected at most 1 s of processor time, needs more; --max-cpu S, if you know who made it"


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> EpisodeFolder:
    """An episode of 250 ticks, which take 15 to 30 ms each."""
    folder = EpisodeFolder(tmp_path_factory.mktemp("slow") / "demos")
    boxes = [box(f"box{number}", basePosition=[0.0, 0.0, 0.1 + 0.2 * number]) for number in range(8)]
    physics = {"setPhysicsEngineParameter": {"numSubSteps": 1000}}
    path = write_world(folder.path.parent, collision=(FLOOR,), dynamic=tuple(boxes), **physics)
    world = new_world(load_world(path))
    episode, part = folder.begin(seeds="")
    try:
        with EpisodeBag(part / BAG, world) as bag:
            bag.start()
            for _ in range(250):
                bag.before_step()
                bag.after_step(world.step())
            bag.end()
    finally:
        world.close()
    episode.state, episode.topics = "complete", measure_topics(part / BAG)
    folder.complete(part, episode)
    return folder


@pytest.mark.thorough
def test_verify_ends_an_episode_with_slow_ticks(slow, run) -> None:
    code, text = run("verify", slow.path, "--max-cpu", 1)
    assert code == 1 and text == f"episode 0: {TOO_SLOW}\n0 of 1 episodes are the same\n"


@pytest.mark.thorough
def test_view_ends_a_page_that_takes_long(slow, run, monkeypatch, tmp_path: Path) -> None:
    def spin(*_, **__):
        while True:
            pass

    monkeypatch.setattr(view, "scene_of_episode", spin)
    code, text = run("view", slow.path, 0, "--out", tmp_path / "page.html", "--max-cpu", 1)
    assert code == 1 and f"demos: {TOO_SLOW}" in text and not (tmp_path / "page.html").exists()
