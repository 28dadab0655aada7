"""The kinds of hostile bags, and one for each seed."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from .contents import long_names, many_columns, many_topics, many_values, no_two_alike, several_types
from .definitions import empties, known, nested, spoilt_definition
from .files import changed_bytes, false_index, large_chunks
from .sessions import commands_and_states, world_descriptions

MAKERS: dict[str, Callable[[random.Random, Path], None]] = {
    "types in types": nested,
    "arrays of nothing": empties,
    "known types, other definitions": known,
    "spoilt definitions": spoilt_definition,
    "long names": long_names,
    "many columns": many_columns,
    "no two messages alike": no_two_alike,
    "many values": many_values,
    "topics": many_topics,
    "several types on a topic": several_types,
    "index": false_index,
    "chunks": large_chunks,
    "bytes": changed_bytes,
    "bytes again": changed_bytes,
    "world descriptions": world_descriptions,
    "commands and states": commands_and_states,
}
"""Changes of a bag by name."""


class Hostile(NamedTuple):
    """A hostile bag.

    Attributes:
        seed: By which it was made.
        how: What was done.
        path: The file, in a folder of its own; code in it makes `canary` in the same folder.
    """

    seed: int
    how: str
    path: Path


def hostile_bags(seeds: range, folder: Path) -> Iterator[Hostile]:
    """Yields a hostile bag for each seed; all kinds come equally often."""
    for seed in seeds:
        place = folder / f"bag{seed}"
        place.mkdir()
        how = list(MAKERS)[seed % len(MAKERS)]
        path = place / "some.bag"
        MAKERS[how](random.Random(f"bag {seed}"), path)
        yield Hostile(seed, how, path)
