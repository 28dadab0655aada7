"""Simulates episodes again, and compares states and messages with the recordings."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import NamedTuple

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.foreign import printable
from custom_ros_tools.plugins import trust_only
from rpbi.replay.parallel import TooSlowError, groups_of, in_forks, limit_cpu_time, merged
from rpbi.replay.session import RecordedPart, Recording, Replay, ReplayResult

from .bags import seals_of
from .compared_messages import Compared, Comparison
from .errors import EpisodeError
from .files import changed_files, newer_files
from .folder import SEAL, Episode, EpisodeFolder
from .session_messages import MAX_TICKS, recorded_episode, require_few_ticks

_PROGRAM = "import sys; from rpbi_data.episodes.verified_messages import main; main(sys.argv[1:])"


MAX_CPU_S = 3600
"""Default limit of the processor time for an episode [s]."""


class ReplayLimits(NamedTuple):
    """Limits on the verification of an episode.

    Attributes:
        max_ticks: Largest number of ticks.
        any_size: Whether the bag may exceed the limits of `BagReader`.
        cpu_s: Largest processor time of each process that simulates the episode [s].
    """

    max_ticks: int = MAX_TICKS
    any_size: bool = False
    cpu_s: int = MAX_CPU_S


USUAL_LIMITS = ReplayLimits()


class Verdict(NamedTuple):
    """Result of the verification of an episode.

    Attributes:
        number: Number of the episode.
        is_same: Whether all states and messages agree, and the stored files are unchanged.
        text: Result of the comparison in words.
        label: Label of the episode; empty if the episode cannot be read.
        notes: Messages about changed original files, and about differences that are not faults.
    """

    number: int
    is_same: bool
    text: str
    label: str = ""
    notes: Sequence[str] = ()


def verify_all(
    folder: EpisodeFolder, numbers: Sequence[int], jobs: int, trust: Sequence[str], limits: ReplayLimits = USUAL_LIMITS
) -> Iterator[Verdict]:
    """Simulates episodes again, each in a separate process, and yields the results in the order of `numbers`.

    Args:
        folder: The folder of episodes.
        numbers: Numbers of the episodes.
        jobs: Largest number of simultaneous processes.
        trust: Python packages from which classes named in episodes may be imported.
        limits: Limits on each episode.
    """
    each = max(1, jobs // max(1, len(numbers)))  # processes per episode, for episodes with keyframes
    with ThreadPoolExecutor(jobs) as pool:
        yield from pool.map(partial(_verify_in_process, folder, trust, limits, each), numbers)


def _verify_in_process(
    folder: EpisodeFolder, trust: Sequence[str], limits: ReplayLimits, jobs: int, number: int
) -> Verdict:
    arguments = [str(folder.path), str(number), json.dumps(limits), str(jobs), *trust]
    command = [sys.executable, "-c", _PROGRAM, *arguments]
    done = subprocess.run(command, capture_output=True, text=True)
    try:
        return Verdict(*json.loads(done.stdout.splitlines()[-1]))
    except (IndexError, ValueError, TypeError):
        if done.returncode == -signal.SIGXCPU:
            return Verdict(number, False, str(TooSlowError(limits.cpu_s)))
        words = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        return Verdict(number, False, f"the simulation ended early: {words}")


def main(words: Sequence[str]) -> None:
    """Verifies one episode and prints the result as JSON.

    Args:
        words: Command-line arguments: folder, number of the episode, limits as JSON, number of processes, and trusted
            packages.
    """
    path, number, limits, jobs, *trust = words
    trust_only({"rpbi", *trust}, "--trust PACKAGE, if you know who recorded the episode")
    given = ReplayLimits(*json.loads(limits))
    limit_cpu_time(given.cpu_s)
    verdict = verify(EpisodeFolder(path), int(number), given, int(jobs))
    print(f"\n{json.dumps(verdict)}", flush=True)


def verify(folder: EpisodeFolder, number: int, limits: ReplayLimits = USUAL_LIMITS, jobs: int = 1) -> Verdict:
    """Simulates an episode again with its stored files, and compares states and messages with the recording.

    Args:
        folder: The folder of episodes.
        number: Number of the episode.
        limits: Limits on the episode.
        jobs: Largest number of simultaneous processes, for an episode with keyframes.
    """
    try:
        episode = folder.read(number)
    except EpisodeError as error:
        return Verdict(number, False, str(error))
    notes = [f"note: {each}" for each in newer_files(episode.files)]
    try:
        changed = list(changed_files(episode.files, folder.files))
        is_same, text, own_notes = _replay(folder, episode, limits, jobs)
        notes += own_notes
    except (InterfaceError, OSError) as error:
        return Verdict(number, False, "; ".join(str(error).splitlines()), episode.label, notes)
    except Exception as error:  # a bag may have anything in it
        words = f"cannot be simulated: {type(error).__name__}: {error}"
        return Verdict(number, False, words, episode.label, notes)
    return Verdict(number, is_same and not changed, "; ".join([*changed, text]), episode.label, notes)


def _replay(folder: EpisodeFolder, episode: Episode, limits: ReplayLimits, jobs: int) -> tuple[bool, str, list[str]]:
    """Simulates an episode again. Returns whether it equals the recording, a text about the outcome, and notes.

    For the notes, see `_message_faults`.
    """
    with recorded_episode(folder, episode, limits.any_size) as (bag, recording):
        require_few_ticks(bag, recording, limits.max_ticks)
        compare = partial(_compare, bag, episode.namespace, recording)
        results, comparisons = zip(*in_forks(compare, groups_of(recording.parts(), jobs), limits.cpu_s))
    result, compared = merged(results), Compared.merged(comparisons)
    faults, notes = _message_faults(bag, episode, compared, limits.any_size)
    words = [*recording.description.warnings, *faults, _words(result, compared, bool(faults))]
    return result.difference is None and not result.left_out and not faults, "; ".join(words), notes


def _compare(
    bag: Path, namespace: str, recording: Recording, parts: Sequence[RecordedPart]
) -> tuple[ReplayResult, Compared]:
    with Comparison(bag, namespace) as comparison:
        result = Replay(recording, observe=comparison.observe).run(parts)
    return result, comparison.result


def _message_faults(bag: Path, episode: Episode, comparison: Compared, any_size: bool) -> tuple[list[str], list[str]]:
    """Returns messages about changed topics, and notes about unchanged topics that differ in the replay.

    A sensor may have an internal state, such as a zero offset set by a service. The sensor's messages may then differ
    in the replay. Such a difference is a fault only if the topic's messages do not match a stored SHA-256.
    """
    seals = {topic: each[SEAL] for topic, each in episode.topics.items() if SEAL in each}
    found = seals_of(bag, any_size=any_size) if seals else {}
    broken = {topic for topic in seals.keys() | found.keys() if seals.get(topic) != found.get(topic)}
    faults, notes = [], []
    for topic, each in sorted(comparison.differences.items()):
        text = f"{each} ({comparison.different[topic]} of {comparison.compared[topic]} differ)"
        if each.is_certain or topic in broken or topic not in seals:
            faults.append(text)
        else:
            notes.append(f"note: the replay differs, but the messages are those that were recorded: {text}")
    for topic in sorted(broken - comparison.differences.keys()):
        faults.append(f"{printable(topic)}: its messages are not those that were recorded")
    return faults, notes


def _words(result: ReplayResult, comparison: Compared, has_faults: bool) -> str:
    if result.difference is not None:
        each, last = result.difference.checkpoint, result.difference.last_agreement
        since = "the first state" if last is None else f"the same until tick {last.tick}"
        return f"differs at {each} ({since}): recorded {each.state_hash}, now {result.difference.state_hash}"
    if result.left_out:
        return "; ".join(f"not simulated {text}" for text in result.left_out)
    states = f"{result.agreed} states over {result.ticks} ticks"
    if has_faults:
        return f"its states are the same ({states})"
    compared = comparison.compared
    return f"same: {states}, {sum(compared.values())} messages of {len(compared)} topics"
