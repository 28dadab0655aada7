"""Recordings and user code from before modules moved to rpbi_data still work.

In `recorded/` are an episode of a farm, its policy, and a saved world, made with the commit 0ed45241.
"""

from __future__ import annotations

import pkgutil
from pathlib import Path

import pytest

from custom_ros_tools.config import load_config
from rpbi.world import World
from rpbi.world.saved.description import WorldDescription
from rpbi.world.saved.state import WorldState
from rpbi_data.episodes.bags import episodes_to_dataframes
from rpbi_data.episodes.folder import BAG, EpisodeFolder
from rpbi_data.episodes.session_messages import read_recording
from rpbi_data.farm.policy import POLICIES

RECORDED = Path(__file__).parent / "recorded"
NAMES = {
    "episodes:EpisodeFolder": "rpbi_data.episodes.folder:EpisodeFolder",
    "episodes:episodes_to_dataframes": "rpbi_data.episodes.bags:episodes_to_dataframes",
    "episodes.datasets.format:CameraFeature": "rpbi_data.datasets.format:CameraFeature",
    "episodes.datasets.format:DatasetFormat": "rpbi_data.datasets.format:DatasetFormat",
    "episodes.datasets.format:ExportedEpisode": "rpbi_data.datasets.format:ExportedEpisode",
    "episodes.datasets.format:Feature": "rpbi_data.datasets.format:Feature",
    "episodes.datasets.format:Schema": "rpbi_data.datasets.format:Schema",
    "episodes.farm:Policy": "rpbi_data.farm.policy:Policy",
    "episodes.farm.policy:Policy": "rpbi_data.farm.policy:Policy",
    "rpbi_utils:Recorder": "rpbi_data.bags.recorded_topics:Recorder",
    "rpbi_utils:align": "rpbi_data.bags.resampling:align",
    "rpbi_utils:bag_to_dataframe": "rpbi_data.bags.bag_reader:bag_to_dataframe",
    "rpbi_utils:bag_to_dataframes": "rpbi_data.bags.bag_reader:bag_to_dataframes",
    "rpbi_utils:bag_to_images": "rpbi_data.bags.images:bag_to_images",
    "rpbi_utils:resample": "rpbi_data.bags.resampling:resample",
    "rpbi_utils:topic_report": "rpbi_data.bags.topic_report:topic_report",
    "rpbi_utils:transforms_between": "rpbi_data.bags.transforms:transforms_between",
    "rpbi_utils:write_images": "rpbi_data.bags.images:write_images",
    "rpbi_utils:write_video": "rpbi_data.bags.images:write_video",
    "rpbi_utils.labelled_images.dataset:write_labelled_images": "rpbi_data.labels.dataset:write_labelled_images",
}
"""Names that pages had, and where each is now."""


def bodies_of(description: WorldDescription) -> set[str]:
    """Returns the names of the bodies of a world that a description builds."""
    world = World.from_description(description)
    names = set(world.bodies)
    world.close()
    return names


@pytest.mark.parametrize("old", NAMES)
def test_an_old_name_is_the_same_object(old: str) -> None:
    assert pkgutil.resolve_name(old) is pkgutil.resolve_name(NAMES[old])


@pytest.mark.parametrize("package", ["rpbi_utils", "episodes"])
def test_old_packages_have_no_other_names(package: str) -> None:
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'bag_to_nothing'"):
        pkgutil.resolve_name(f"{package}:bag_to_nothing")


def test_an_episode_from_before_is_read() -> None:
    folder = EpisodeFolder(RECORDED / "episodes")
    (episode,) = folder.all()
    assert (episode.state, episode.label) == ("complete", "success")
    tables = episodes_to_dataframes(folder.path)
    assert set(tables) == {"/clock", "/rpbi/state", "/rpbi/world_description"}
    recording = read_recording(folder.folder_of(0) / BAG)
    assert bodies_of(recording.description) == {"box", "floor"}


def test_a_policy_from_before_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(RECORDED))
    name = load_config(str(RECORDED / "episodes/farm.yaml"))["policy"]
    assert POLICIES.configured(name, "--policy").__name__ == "Push"


def test_a_saved_world_from_before_is_built() -> None:
    state = WorldState.read(RECORDED / "state.world")
    assert bodies_of(WorldDescription(state.description)) == {"box", "floor"}
    assert state.tick == 10
