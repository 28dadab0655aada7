"""Messages of an episode that were changed after the recording are named, whatever the states say."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import rosbag
from worlds import FLOOR, box, iiwa, write_world

from rpbi.control.joint_command import JointCommand
from rpbi.world.loading import load_world
from rpbi_data.episodes.bags import measure_topics
from rpbi_data.episodes.folder import BAG, SEAL, EpisodeFolder, write_facts
from rpbi_data.episodes.verified_messages import verify
from rpbi_data.farm.ros.bag import EpisodeBag
from rpbi_data.farm.ros.maker import new_world

TICKS = 300
JOINT = "lbr_iiwa_joint_7"
STATES, TARGETS = "/rpbi/iiwa/joint_states", "/rpbi/iiwa/joint_states/target"
WRENCH, CONTACTS, TF = f"/rpbi/iiwa/{JOINT}/ft_sensor", "/rpbi/box/contacts", "/tf"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> EpisodeFolder:
    """An episode of an arm with a force-torque sensor and a box that falls; not to be changed."""
    folder = EpisodeFolder(tmp_path_factory.mktemp("recorded") / "demos")
    arm = iiwa(enabled_joint_force_torque_sensors=[JOINT])
    thing = box("box", basePosition=[0.6, 0.3, 0.3], contacts={"hz": 100}, broadcast_hz=50)
    path = write_world(
        folder.path.parent, collision=(FLOOR,), dynamic=(thing,), robots=(arm,), timeStep=0.002, state_hash_hz=20.0
    )
    world = new_world(load_world(path))
    episode, part = folder.begin(seeds="")
    try:
        with EpisodeBag(part / BAG, world) as bag:
            bag.start()
            for tick in range(TICKS):
                if tick % 50 == 0:
                    world.put("iiwa/target", JointCommand(["lbr_iiwa_joint_2"], [0.001 * tick], [], [], 0))
                    world.apply_inputs()
                bag.before_step()
                bag.after_step(world.step())
            bag.end()
    finally:
        world.close()
    episode.state, episode.topics = "complete", measure_topics(part / BAG)
    folder.complete(part, episode)
    return folder


def change(topic: str, edit: Callable[[Any], None], at: int = -20) -> Callable[[Path], str]:
    """Returns a function that changes a message of a bag, and returns its stamp."""

    def rewrite(path: Path) -> str:
        with rosbag.Bag(str(path)) as bag:
            messages = list(bag.read_messages())
        chosen = [message for name, message, _ in messages if name == topic][at]
        edit(chosen)
        with rosbag.Bag(str(path), "w") as bag:
            for message in messages:
                bag.write(*message)
        header = chosen.transforms[0].header if topic == TF else chosen.header
        return f"{header.stamp.to_sec():.9f}"

    return rewrite


def add(place: str, much: float) -> Callable[[Any], None]:
    """Returns a function that adds to a value of a message."""
    *parents, last = place.split(".")

    def edit(message: Any) -> None:
        for name in parents:
            message = message[int(name)] if name.isdecimal() else getattr(message, name)
        if last.isdecimal():
            message[int(last)] += much
        else:
            setattr(message, last, getattr(message, last) + much)

    return edit


def listed(message: Any) -> None:
    message.position = [angle + 0.1 for angle in message.position]


def test_an_unchanged_episode_is_the_same_in_all_messages(recorded):
    verdict = verify(recorded, 0)
    assert verdict.is_same and not verdict.notes, verdict
    topics = recorded.read(0).topics
    compared = sum(topics[topic]["messages"] for topic in (STATES, WRENCH, CONTACTS))
    words = verdict.text.split(", ")
    assert words[0].startswith("same: ") and words[1].endswith(f" messages of {4} topics")
    assert int(words[1].split()[0]) >= compared + topics[TF]["messages"]


@pytest.mark.parametrize(
    ("topic", "edit", "place"),
    [
        (STATES, listed, "position[0]"),
        (STATES, lambda message: message.name.__setitem__(0, "other"), "name[0]"),
        (TF, add("transforms.0.transform.translation.x", 1e-9), "transform.translation.x"),
        (WRENCH, add("wrench.force.z", 1e-6), "wrench.force.z"),
        (CONTACTS, add("force.z", 0.5), "force.z"),
    ],
)
@pytest.mark.parametrize("is_sealed", [True, False])
def test_a_changed_value_is_named_with_its_topic_and_time(recorded, tmp_path, topic, edit, place, is_sealed):
    folder = EpisodeFolder(shutil.copytree(recorded.path, tmp_path / "demos"))
    bag = folder.folder_of(0) / BAG
    stamp = change(topic, edit)(bag)
    if not is_sealed:
        episode = folder.read(0)
        for facts in episode.topics.values():
            del facts[SEAL]
        write_facts(folder.folder_of(0), episode)
    verdict = verify(folder, 0)
    assert not verdict.is_same
    assert f"{topic} at {stamp} s: {place}: expected " in verdict.text and ", recorded " in verdict.text, verdict
    assert "(1 of " in verdict.text and "its states are the same" in verdict.text


def test_changed_and_missing_messages_of_other_topics_are_named(recorded, tmp_path):
    folder = EpisodeFolder(shutil.copytree(recorded.path, tmp_path / "demos"))
    change(TARGETS, add("header.stamp.nsecs", 1), at=0)(folder.folder_of(0) / BAG)
    verdict = verify(folder, 0)
    assert not verdict.is_same and f"{TARGETS}: its messages are not those that were recorded" in verdict.text
