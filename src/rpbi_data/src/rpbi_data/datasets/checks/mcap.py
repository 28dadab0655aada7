"""Checks of rosbag2 recordings in MCAP files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rosbags.rosbag2 import ReaderError

from rpbi_data.datasets.layouts.mcap import topics_of

from .values import Facts, guarded


def mcap_faults(folder: Path) -> Iterator[str]:
    """Yields a sentence for each fault of a folder of recordings."""
    facts = Facts(folder)
    yield from guarded("rpbi", _recording_faults(folder, facts))
    yield from facts.faults


def _recording_faults(folder: Path, facts: Facts) -> Iterator[str]:
    names = sorted(each.name for each in folder.iterdir() if each.is_dir() and each.name != "rpbi")
    for index, name in enumerate(names):
        stored = facts.episode(index)
        yield from facts.chain_faults(index, stored)
        try:
            found = topics_of(folder / name)
        except (ReaderError, OSError, ValueError, KeyError, AssertionError) as error:
            yield f"{name}: cannot be read: {' '.join(str(error).split()) or type(error).__name__}"
            continue
        except Exception as error:  # a damaged file makes its reader fail in many ways
            yield f"{name}: is damaged: {type(error).__name__}: {' '.join(str(error).split())}"
            continue
        expected = stored.get("topics", {})
        for topic in sorted(expected.keys() | found.keys() if expected else ()):
            ours, theirs = expected.get(topic), found.get(topic)
            if ours is None or theirs is None:
                yield f"{name}: {topic}: {'was not exported' if ours is None else 'was exported and is missing'}"
            elif ours["messages"] != theirs["messages"]:
                yield f"{name}: {topic}: {ours['messages']} messages were exported, found {theirs['messages']}"
            elif ours != theirs:
                yield f"{name}: {topic}: stamps or contents were changed after the export"
    yield from facts.total_faults(len(names))
