"""Reads the content of an HTML page, which shows a recording, from a bag."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from rpbi.replay.session import Recording
from rpbi.world import World
from rpbi_data.bags.bag_reader import BagReader, bag_to_dataframes
from rpbi_data.bags.limits import BagError
from rpbi_data.episodes.folder import EpisodeFolder
from rpbi_data.episodes.session_messages import read_recording, recorded_episode

from .bodies import add_later_bodies, links_of
from .first_view import first_view
from .forces import contact_arrows, force_panels, wrench_arrows
from .frames import Frames
from .meshes import meshes_of
from .scene import MAX_HZ, MAX_POSES, Array, PageScene

CONTACTS, WRENCHES, JOINTS, TF = (
    "ros_pybullet_interface/Contacts",
    "geometry_msgs/WrenchStamped",
    "sensor_msgs/JointState",
    "tf2_msgs/TFMessage",
)


def scene_of_episode(folder: EpisodeFolder, number: int, *, any_size: bool = False) -> PageScene:
    """Returns the page content that shows an episode. The world is built from the files stored with the episode.

    Raises:
        EpisodeError: If the folder has no such episode, or the episode has no bag.
        BagError: If the bag cannot be read.
        ConfigError: If the recorded world cannot be built.
    """
    episode = folder.read(number)
    with recorded_episode(folder, episode, any_size, is_replayed=False) as (bag, recording):
        title = f"Episode {number}{f' ({episode.label})' if episode.label else ''} of {folder.path.resolve().name}"
        return _scene(title, bag, episode.namespace, recording, any_size)


def scene_of_bag(bag: Path, namespace: str = "/", *, any_size: bool = False) -> PageScene:
    """Returns the page content that shows a bag with `rpbi/world_description`. The world is built from files on disk.

    Raises:
        BagError: If the bag cannot be read, or lacks the topic.
        ConfigError: If the recorded world cannot be built.
    """
    return _scene(bag.name, bag, namespace, read_recording(bag, namespace, any_size, needs_states=False), any_size)


def _scene(title: str, bag: Path, namespace: str, recording: Recording, any_size: bool) -> PageScene:
    prefix = f"/{namespace.strip('/')}/rpbi/" if namespace.strip("/") else "/rpbi/"
    with BagReader(bag, any_size) as reader:
        kinds = {topic: sorted({each.name for each in of_topic}) for topic, of_topic in reader.types.items()}
    types = {topic: of_topic[0] for topic, of_topic in kinds.items() if len(of_topic) == 1}
    mixed = [
        f"{topic} is not shown: expected messages of one type, got {' and '.join(kinds[topic])}"
        for topic in kinds.keys() - types.keys()
    ]
    of_type = {wanted: [each for each in types if wanted == types[each]] for wanted in (CONTACTS, WRENCHES, JOINTS, TF)}
    state = [topic for topic in types if topic == f"{prefix}state"]
    joints = [topic for topic in of_type[JOINTS] if topic.startswith(prefix) and topic.endswith("/joint_states")]
    forces = [*of_type[CONTACTS], *of_type[WRENCHES]]
    tables = bag_to_dataframes(bag, sorted({*of_type[TF], *state, *joints, *forces}), any_size=any_size)
    world = World.from_description(recording.description)
    try:
        at_start = list(world.bodies)
        notes = [*sorted(mixed), *recording.description.warnings, *add_later_bodies(world, recording.commands)]
        links = sum(1 + len(body.link_indices) for body in world.bodies.values())
        of_simulator = {topic: table for topic, table in tables.items() if topic.startswith(prefix)}
        start_s, times = _times(bag, of_simulator, MAX_POSES // max(1, links))
        frames = Frames(tables, world.frames(), start_s + times)
        of_body = {topic.removeprefix(prefix).removesuffix("/joint_states"): tables[topic] for topic in joints}
        states = tables[state[0]] if state else None
        shown, more = links_of(world, at_start, recording.commands, states, frames, of_body)
        own_camera = world.config.resetDebugVisualizerCamera
    finally:
        world.close()
    meshes, of_meshes = meshes_of(shape for link in shown for shape in link.shapes)
    camera = first_view(own_camera, shown, meshes)
    scene = PageScene(title, start_s, times, camera, shown, meshes, notes=[*notes, *more, *of_meshes])
    scene.arrows = [contact_arrows(topic, tables[topic], frames.times) for topic in of_type[CONTACTS]]
    for topic in of_type[WRENCHES]:
        found = wrench_arrows(topic, tables[topic], frames)
        if isinstance(found, str):
            scene.notes.append(found)
        else:
            scene.arrows.append(found)
    scene.panels = force_panels({topic: tables[topic] for topic in forces}, start_s)
    scene.notes += frames.notes
    return scene.with_few_arrows()


def _times(bag: Path, tables: Mapping[str, pd.DataFrame], most: int) -> tuple[float, Array]:
    """Returns the time of the first message [s], and at most `most` evenly spaced times up to the last message.

    The evenly spaced times are measured from the first message, shape (n,) [s].
    """
    stamps = [table.index for table in tables.values() if len(table) > 1]
    start_s = min((float(each[0]) for each in stamps), default=0.0)
    seconds = max((float(each[-1]) for each in stamps), default=0.0) - start_s
    if seconds <= 0.0:
        raise BagError(bag, "expected joint states, contacts or states of the simulator over some time, found none")
    count = max(2, min(math.ceil(seconds * MAX_HZ) + 1, most))
    return start_s, np.linspace(0.0, seconds, count)
