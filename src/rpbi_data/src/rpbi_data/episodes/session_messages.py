"""Reads the recorded session of a simulator from a bag, or from an episode with its stored files."""

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
"""Default limit on the number of ticks in a recording: 5.5 hours of a world at 1 kHz."""
_TYPES: dict[str, Any] = {
    "rpbi/world_description": String,
    "rpbi/state": SimulationState,
    "rpbi/commands": WorldCommands,
}
"""Message types of a session's topics, indexed by topic name relative to the simulator's namespace."""
_Commands = dict[int, dict[int, RecordedCommand]]
"""Commands, indexed by the number of preceding resets and then by the command's index."""


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
    """Reads the session of one simulator from a bag.

    Args:
        path: Path of the bag, in which the simulator was not restarted.
        namespace: Namespace of the simulator; other simulators in the bag are ignored.
        any_size: Whether the bag may exceed the limits of `BagReader`.
        earlier: Bag with `rpbi/commands` from before the recording; None if there is no such bag.
        relocate: Function that returns the world's description with other file names.
        names: New paths of the files named in keyframes, indexed by recorded path.
        needs_states: Whether the bag must contain state hashes to compare, as for a replay.

    Raises:
        BagError: If the bag does not exist, is damaged, contains several sessions, or lacks a required topic.
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
    """Context manager that yields the bag of an episode, and the session in the bag.

    In this session, the world's description refers to copies of files in a temporary folder, which exists until the end
    of the context.

    Args:
        folder: The folder of episodes.
        episode: The episode.
        any_size: See `read_recording`.
        is_replayed: Whether the session will be simulated again. If so, the bag must contain state hashes, and
            keyframes are changed to refer to the copies, too.

    Raises:
        EpisodeError: If the episode has no bag, or a stored file cannot be read.
        BagError: If the bag cannot be read.
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
    """Checks the number of ticks in a recording, including the ticks before resets, and returns this number.

    Args:
        path: Path of the bag, for the error message.
        recording: The recording.
        max_ticks: Largest allowed number of ticks.

    Raises:
        BagError: If the recording has more than `max_ticks` ticks.
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
    """Raises a BagError if the bag lacks a required topic, or a message definition differs from the installed one."""
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
