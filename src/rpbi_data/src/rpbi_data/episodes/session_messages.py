"""Reads the recorded session of a simulator from a bag, or from an episode with the files that are stored with it."""

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import genpy
from std_msgs.msg import String

from ros_pybullet_interface.msg import SimulationState, WorldCommands
from rpbi.replay.session import Checkpoint, Recording
from rpbi.world.keyframes.keyframe import renamed
from rpbi.world.saved.command_log import KEYFRAME, RecordedCommand
from rpbi.world.saved.description import WorldDescription
from rpbi.world.saved.values import from_text, to_text
from rpbi_data.bags.bag_reader import BagReader
from rpbi_data.bags.limits import BagError

from .errors import EpisodeError
from .files import stored_names, with_stored_files
from .folder import BAG, EARLIER, Episode, EpisodeFolder, file_in

MAX_TICKS = 20_000_000
"""Length of a recording beyond which it is refused without `--max-ticks` [ticks]: 5.5 hours of a world at 1 kHz."""
_TYPES: dict[str, Any] = {
    "rpbi/world_description": String,
    "rpbi/state": SimulationState,
    "rpbi/commands": WorldCommands,
}
"""Message type of each topic of a session, by its name relative to the namespace of the simulator."""
_Commands = dict[int, dict[int, RecordedCommand]]
"""Commands by number of resets and index."""


def read_recording(
    path: Path,
    namespace: str = "/",
    any_size: bool = False,
    *,
    earlier: Path | None = None,
    relocate: Callable[[str], str] = lambda description: description,
    names: Mapping[str, str] = MappingProxyType({}),
    needs_states: bool = True,
) -> Recording:
    """Returns the session of one simulator that a bag holds.

    Args:
        path: The bag. It holds one session; the simulator was not restarted during the recording.
        namespace: Namespace of the simulator; other simulators in the bag are ignored.
        any_size: Whether to read a bag that exceeds the limit on unpacked bytes, see `BagReader`.
        earlier: A bag of `rpbi/commands` before the recording, if there is one.
        relocate: Returns the world's description with other names for its files.
        names: These names, for the files in keyframes, by their own.
        needs_states: Whether states to compare have to be in the bag, as for a replay.

    Raises:
        BagError: If there is no such bag, it is damaged, or it lacks a topic that is needed.
    """
    prefix = f"/{namespace.strip('/')}/" if namespace.strip("/") else "/"
    topics = {f"{prefix}{name}": message_type for name, message_type in _TYPES.items()}
    with BagReader(path, any_size) as bag:
        _check(bag, topics, prefix, needs_states)
        descriptions: list[str] = []
        checkpoints: set[Checkpoint] = set()
        commands: _Commands = {}
        for topic, _, raw, _ in bag.messages([topic for topic in topics if topic in bag.types]):
            message = topics[topic]()
            try:
                message.deserialize(raw)
            except genpy.DeserializationError as error:
                raise BagError(path, f"damaged: a message of {topic}: {error}") from None
            if isinstance(message, String):
                descriptions.append(message.data)
            elif isinstance(message, SimulationState):
                if message.state_hash:
                    checkpoints.add(Checkpoint(message.resets, message.tick, message.commands, message.state_hash))
            else:
                _add_commands(message, commands)
    if len(set(descriptions)) != 1:
        raise BagError(path, "the simulator was restarted during the recording; expected a bag of one session")
    if needs_states and not any(checkpoint.tick for checkpoint in checkpoints):
        raise BagError(path, "no hashes in rpbi/state to compare (state_hash_hz in the main file is their rate)")
    try:
        if earlier is not None:
            _read_commands(earlier, f"{prefix}rpbi/commands", any_size, commands)
        if names:
            _rename(commands, names)
        return Recording(WorldDescription(relocate(descriptions[0])), commands, checkpoints)
    except ValueError as error:
        raise BagError(path, str(error)) from None


@contextmanager
def recorded_episode(
    folder: EpisodeFolder, episode: Episode, any_size: bool = False, *, is_replayed: bool = True
) -> Iterator[tuple[Path, Recording]]:
    """Yields the bag of an episode and its session, whose files are copies in a folder until the end of the context.

    Args:
        folder: The folder of the episode.
        episode: The episode.
        any_size: As for `read_recording`.
        is_replayed: Whether it is simulated again: it needs states to compare, and its keyframes name the copies.

    Raises:
        EpisodeError: If it has no bag, or a stored file cannot be read.
        BagError: If its bag cannot be read.
    """
    place = folder.folder_of(episode.number)
    bag = file_in(place, BAG)
    if bag is None:
        raise EpisodeError(place, episode.note or "has no bag")
    with tempfile.TemporaryDirectory(prefix="episode-") as name:
        copies = Path(name)
        recording = read_recording(
            bag,
            episode.namespace,
            any_size,
            earlier=file_in(place, EARLIER),
            relocate=lambda text: with_stored_files(text, episode.files, folder.files, copies),
            names=stored_names(episode.files, copies) if is_replayed else {},
            needs_states=is_replayed,
        )
        yield bag, recording


def _rename(commands: _Commands, names: Mapping[str, str]) -> None:
    for life in commands.values():
        for index, each in life.items():
            if each.what == KEYFRAME:
                life[index] = each._replace(data=to_text(renamed(str(from_text(each.data)), names)))


def require_few_ticks(path: Path, recording: Recording, max_ticks: int) -> int:
    """Returns the number of ticks of a recording, all its resets together.

    Args:
        path: Its bag, for the message.
        recording: The recording.
        max_ticks: The largest number.

    Raises:
        BagError: If it has more.
    """
    last_ticks = {each.resets: each.tick for each in sorted(recording.checkpoints)}
    ticks = sum(last_ticks.values())
    if ticks > max_ticks:
        message = f"expected at most {max_ticks} ticks, got states that are {ticks} ticks from the start"
        raise BagError(path, f"{message}; --max-ticks {ticks}, if you know who made it")
    return ticks


def _read_commands(path: Path, topic: str, any_size: bool, commands: _Commands) -> None:
    with BagReader(path, any_size) as bag:
        for _, _, raw, _ in bag.messages([topic]):
            message = WorldCommands()
            try:
                message.deserialize(raw)
            except genpy.DeserializationError as error:
                raise BagError(path, f"damaged: a message of {topic}: {error}") from None
            _add_commands(message, commands)


def _add_commands(message: WorldCommands, commands: _Commands) -> None:
    numbered = enumerate(message.commands, message.first)
    of_life = commands.setdefault(message.resets, {})
    of_life.update({i: RecordedCommand(one.tick, one.name, one.what, one.data) for i, one in numbered})


def _check(bag: BagReader, topics: dict[str, Any], prefix: str, needs_states: bool) -> None:
    """Raises a BagError if the bag lacks a topic or holds one with the message definition of another version."""
    needed = [f"{prefix}rpbi/world_description", *([f"{prefix}rpbi/state"] if needs_states else ())]
    missing = [topic for topic in needed if not bag.counts.get(topic)]
    if missing:
        others = sorted(topic for topic in bag.types if topic.endswith("/rpbi/world_description"))
        elsewhere = f"; it has {', '.join(others)}: use --ns" if others else ""
        reason = "which a replay needs" if needs_states else "which describes the world"
        raise BagError(bag.path, f"no messages of {', '.join(missing)}, {reason}{elsewhere}")
    for topic, message_type in topics.items():
        for md5sum in bag.md5sums.get(topic, ()):
            if md5sum != message_type._md5sum:
                raise BagError(bag.path, f"{topic} is not {message_type._type} of this version")
