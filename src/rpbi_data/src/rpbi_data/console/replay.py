"""The command `replay`."""

import logging
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from tqdm import tqdm

from custom_ros_tools.console.argument import Argument, UsageError
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.foreign import printable_lines
from custom_ros_tools.plugins import trust_only
from rpbi.replay.parallel import groups_of, in_forks, merged
from rpbi.replay.session import Replay, ReplayResult
from rpbi_data.bags.limits import BagError
from rpbi_data.episodes.session_messages import MAX_TICKS, read_recording, require_few_ticks


def replay(
    bag: Annotated[Path, Argument("BAG", parse=Path, files="*.bag")] = Path("out/demo/recording.bag"),
    *,
    ns: Annotated[str, Argument("NAMESPACE")] = "/",
    quiet: Annotated[bool, Argument("")] = False,
    trust: Annotated[Sequence[str], Argument("PACKAGE ...")] = (),
    max_ticks: Annotated[int, Argument("N", parse=int)] = MAX_TICKS,
    any_size: Annotated[bool, Argument("")] = False,
    jobs: Annotated[int, Argument("N", parse=int)] = 1,
) -> int:
    """Simulates a recorded session again, and compares the states with the recorded states.

    The exit code is 1 if a state differs or a part of the recording cannot be simulated. No ROS master is needed.

    Args:
        bag: the recording; default: out/demo/recording.bag, which `./rpbi demo` records
        ns: namespace of the recorded simulator; default: /
        quiet: shows no progress bar
        trust: Python packages from which classes named in the bag may be imported, such as object types
        max_ticks: refuses recordings of more than N ticks; default: 20,000,000, which is 5.5 hours at 1 kHz
        any_size: also reads a bag whose unpacked size exceeds both 1 GiB and 255 times its file size
        jobs: number of processes, which simulate the parts between keyframes at the same time; default: 1
    """
    if jobs < 1:
        raise UsageError(f"--jobs: expected at least 1, got {jobs}")
    logging.basicConfig(format="replay: %(message)s", level=logging.ERROR)
    trust_only({"rpbi", *trust}, "--trust PACKAGE, if you know who made the bag")
    try:
        recording = read_recording(bag, ns, any_size)
        for warning in recording.description.warnings:
            print(f"replay: warning: {printable_lines(str(warning))}", file=sys.stderr)
        ticks = require_few_ticks(bag, recording, max_ticks)
        with tqdm(total=ticks, unit=" ticks", unit_scale=True, leave=False, disable=quiet) as bar:
            groups = groups_of(recording.parts(), jobs)
            result = merged(in_forks(lambda parts: Replay(recording, bar.update).run(parts), groups))
    except (InterfaceError, OSError):
        raise
    except Exception as error:  # a bag may have anything in it
        raise BagError(bag, f"cannot be replayed: {type(error).__name__}: {error}") from error
    return _report(result)


def _report(result: ReplayResult) -> int:
    for text in result.left_out:
        print(f"not replayed {printable_lines(text)}")
    difference = result.difference
    if difference is not None:
        agreement = difference.last_agreement
        since = "from the start on" if agreement is None else f"after tick {agreement.tick}, where all was the same"
        recorded = difference.checkpoint.state_hash
        print(f"first difference at {difference.checkpoint}, {since}: recorded {recorded}, now {difference.state_hash}")
        return 1
    print(f"{result.agreed} states agree over {result.ticks} ticks")
    return 1 if result.left_out else 0
