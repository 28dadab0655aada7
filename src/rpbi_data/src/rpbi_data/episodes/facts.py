"""Validates untrusted `episode.yaml` files: types, limits, and texts that are safe to print on a terminal."""

from __future__ import annotations

from functools import partial
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from custom_ros_tools.config import load_configs
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.foreign import MAX_PATH_BYTES, printable
from custom_ros_tools.schema import ConfigModel, Count, Expects, NonNegative, Text

MAX_BYTES = 2_000_000
"""Largest size of `episode.yaml` [bytes]."""
MAX_LABEL, MAX_NOTE = 100, 2_000
"""Largest number of characters of a label, and of a note."""
MAX_FILES = 2_000
"""Largest number of a world's files that are stored with an episode."""
MAX_TOPICS = 10_000
MAX_NUMBER = 10**12 - 1
"""Largest value of an episode's number."""

Line = Annotated[str, AfterValidator(printable)]
"""A text in one line, in which characters that a terminal may interpret are escaped."""


Digest = Annotated[str, Field(pattern="^([0-9a-f]{64})?$"), Expects("64 hex digits")]
"""SHA-256 in 64 hexadecimal digits, or an empty text."""


def _path(text: str) -> str:
    """Resolves `..` in a path, and returns the path; raises a ValueError unless the path is absolute and below `/`."""
    parts: list[str] = []
    for part in text.split("/"):
        if part == ".." and not parts:
            raise ValueError(f"expected a path that stays below its root, got {printable(text, MAX_LABEL)}")
        if part == "..":
            parts.pop()
        elif part not in ("", "."):
            parts.append(part)
    if not text.startswith("/") or not parts or printable(text, MAX_PATH_BYTES) != text:
        raise ValueError(f"expected an absolute path without control characters, got {printable(text, MAX_LABEL)}")
    return "/" + "/".join(parts)


Path = Annotated[Text, AfterValidator(_path)]
"""Absolute path of a file on the recording machine. Readers map the path into a folder, see `path_below`."""


class TopicFacts(ConfigModel):
    """Properties of a topic in the bag, see `Episode.topics`."""

    type: Line
    messages: Count
    rate_hz: NonNegative
    max_gap_s: NonNegative
    set_back_s: NonNegative = 0.0
    sha256: Digest = ""


class FileFacts(ConfigModel):
    """Data on a file named in the world's description, as returned by `rpbi_data.episodes.files.store_files`."""

    path: Path
    sha256: Digest
    meshes: dict[str, Path] = Field(default_factory=dict, max_length=MAX_FILES)


class EpisodeFacts(ConfigModel):
    """Validated attributes of an `Episode`."""

    number: Annotated[int, Field(ge=0, le=MAX_NUMBER)]
    state: Literal["recording", "complete", "incomplete", "recovered"] = "recording"
    label: Annotated[str, AfterValidator(partial(printable, most=MAX_LABEL))] = ""
    note: Annotated[str, AfterValidator(partial(printable, most=MAX_NOTE))] = ""
    started: Line = ""
    seconds: NonNegative = 0.0
    namespace: Line = "/"
    seeds: Line = ""
    versions: dict[Line, Line] = Field(default_factory=dict, max_length=100)
    git: Line = ""
    files: list[FileFacts] = Field(default_factory=list, max_length=MAX_FILES)
    published: dict[Line, Count] = Field(default_factory=dict, max_length=MAX_TOPICS)
    topics: dict[Line, TopicFacts] = Field(default_factory=dict, max_length=MAX_TOPICS)


def facts_in(text: str, file: str) -> dict[str, Any]:
    """Parses the attributes of an `Episode` from a YAML text.

    Args:
        text: The YAML text.
        file: Name of the file that contains the text, for error messages.

    Raises:
        ConfigError: If the text is not YAML, or a value has a wrong type or exceeds a limit.
    """
    facts = EpisodeFacts.parse(load_configs(text, file, MAX_BYTES), file)
    return facts.model_dump(exclude_unset=True)


def checked_label(label: str) -> str:
    """Checks a label of an episode, and returns the unchanged label.

    Raises:
        InterfaceError: If the label is too long, or has control characters.
    """
    if printable(label, MAX_LABEL) != label:
        given = printable(label, MAX_LABEL)
        raise InterfaceError(
            f"expected a label of at most {MAX_LABEL} characters without control characters, got '{given}'"
        )
    return label
