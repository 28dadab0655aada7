"""The command `replay`: runs a recorded session again and compares its states."""

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import genpy
import rospy
from std_msgs.msg import String
from tqdm import tqdm

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.plugins import trust_only
from ros_pybullet_interface.msg import SimulationState, WorldCommands
from rpbi.replay.session import Checkpoint, RecordedCommand, Recording, Replay, ReplayResult
from rpbi.replay.world_description import WorldDescription
from rpbi_utils.errors import BagError

from .bag_reader import BagReader

_NAME = "replay"
MOST_TICKS = 20_000_000
"""Five hours and a half of a world at 1 kHz."""
_TYPES: dict[str, Any] = {
    "rpbi/world_description": String,
    "rpbi/state": SimulationState,
    "rpbi/commands": WorldCommands,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command, by default with the arguments of the process.

    Returns:
        The exit code: 0 if all states agree, else 1.
    """
    parser = argparse.ArgumentParser(
        prog=_NAME, description="Runs a recorded session again, without ROS, and compares the hashes of its states."
    )
    parser.add_argument("bag", type=Path, metavar="BAG", help="has rpbi/world_description, rpbi/state, rpbi/commands")
    parser.add_argument("--ns", default="/", help="namespace of the simulator; default: %(default)s")
    parser.add_argument(
        "--trust",
        nargs="+",
        default=[],
        metavar="PACKAGE",
        help="Python packages that the bag may have imported for types of objects, sensors and controllers of your own",
    )
    parser.add_argument("--max-ticks", type=int, default=MOST_TICKS, metavar="N", help="default: %(default)s")
    parser.add_argument("--any-size", action="store_true", help="also if it unfolds to 255 times its size and 1 GiB")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    arguments = parser.parse_args(rospy.myargv(sys.argv)[1:] if argv is None else argv)
    logging.basicConfig(format=f"{_NAME}: %(message)s", level=logging.ERROR)
    trust_only({"rpbi", *arguments.trust}, "--trust PACKAGE, if you know who made the bag")
    try:
        recording = read_recording(arguments.bag, arguments.ns, arguments.any_size)
        for warning in recording.description.warnings:
            print(f"{_NAME}: warning: {warning}", file=sys.stderr)
        last_ticks = {each.resets: each.tick for each in sorted(recording.checkpoints)}
        ticks = sum(last_ticks.values())
        if ticks > arguments.max_ticks:
            message = f"expected at most {arguments.max_ticks} ticks, got states that are {ticks} ticks from the start"
            raise BagError(arguments.bag, f"{message}; --max-ticks {ticks}, if you know who made it")
        with tqdm(total=ticks, unit=" ticks", unit_scale=True, leave=False, disable=arguments.quiet) as bar:
            result = Replay(recording, bar.update).run()
    except (InterfaceError, OSError) as error:
        print(f"{_NAME}: {error}", file=sys.stderr)
        return 1
    except Exception as error:  # a bag may have anything in it
        print(f"{_NAME}: {arguments.bag}: cannot be replayed: {type(error).__name__}: {error}", file=sys.stderr)
        return 1
    return _report(result)


def read_recording(path: Path, namespace: str = "/", any_size: bool = False) -> Recording:
    """Reads what a bag has of a session of the simulator in a namespace; for `any_size` see `BagReader`.

    Raises:
        BagError: If there is no such bag, or it lacks what a replay needs.
    """
    prefix = f"/{namespace.strip('/')}/" if namespace.strip("/") else "/"
    topics = {f"{prefix}{name}": message_type for name, message_type in _TYPES.items()}
    with BagReader(path, any_size) as bag:
        _check(bag, topics, prefix)
        descriptions: list[str] = []
        checkpoints: set[Checkpoint] = set()
        commands: dict[int, dict[int, RecordedCommand]] = {}
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
                numbered = enumerate(message.commands, message.first)
                of_life = commands.setdefault(message.resets, {})
                of_life.update({i: RecordedCommand(one.tick, one.name, one.what, one.data) for i, one in numbered})
    if len(set(descriptions)) != 1:
        raise BagError(path, "the simulator was started anew during the recording; a replay needs a bag of one session")
    if not any(checkpoint.tick for checkpoint in checkpoints):
        raise BagError(path, "no hashes in rpbi/state to compare (state_hash_hz in the main file is their rate)")
    try:
        return Recording(WorldDescription(descriptions[0]), commands, checkpoints)
    except ValueError as error:
        raise BagError(path, str(error)) from None


def _check(bag: BagReader, topics: dict[str, Any], prefix: str) -> None:
    """Raises a BagError if the bag lacks topics, or has them from another version."""
    needed = [f"{prefix}rpbi/world_description", f"{prefix}rpbi/state"]
    missing = [topic for topic in needed if not bag.counts.get(topic)]
    if missing:
        others = sorted(topic for topic in bag.types if topic.endswith("/rpbi/world_description"))
        elsewhere = f"; it has {', '.join(others)}: use --ns" if others else ""
        raise BagError(bag.path, f"no messages of {', '.join(missing)}, which a replay needs{elsewhere}")
    for topic, message_type in topics.items():
        for md5sum in bag.md5sums.get(topic, ()):
            if md5sum != message_type._md5sum:
                raise BagError(bag.path, f"{topic} is not {message_type._type} of this version")


def _report(result: ReplayResult) -> int:
    for text in result.left_out:
        print(f"not replayed {text}")
    difference = result.difference
    if difference is not None:
        agreement = difference.last_agreement
        since = "from the start on" if agreement is None else f"after tick {agreement.tick}, where all was the same"
        recorded = difference.checkpoint.state_hash
        print(f"first difference at {difference.checkpoint}, {since}: recorded {recorded}, now {difference.state_hash}")
        return 1
    print(f"{result.agreed} states agree over {result.ticks} ticks")
    return 1 if result.left_out else 0
