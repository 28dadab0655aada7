"""Reads files and texts from untrusted sources: keeps paths inside a folder, limits sizes, and makes texts safe to
print.

In this module, "foreign" means untrusted: from an episode, a saved world, a data set or another node's message.
"""

import errno
import json
import os
import unicodedata
from pathlib import Path
from typing import Any

from .config import MAX_BYTES, MAX_VALUES, load_config, read_file
from .errors import ConfigError, Problem, shortened

MAX_PATH_BYTES = 1000
"""Largest length of a path in a foreign file [bytes]. PyBullet copies paths into buffers of 1024 bytes."""
MAX_DEPTH = 100
"""Largest nesting depth of lists and mappings in a foreign JSON text."""
MAX_ENTRIES = 100_000
"""Largest number of entries in a foreign folder, by default."""


def path_below(folder: str | Path, name: str) -> Path:
    """Joins a trusted folder and a foreign path, and ensures that the result is inside the folder.

    Args:
        folder: The folder, which is trusted and may be a symbolic link.
        name: The foreign path. An absolute path is taken relative to the folder: `/a/b` becomes `FOLDER/a/b`.

    Raises:
        ConfigError: If the foreign path is empty or too long, has `..` or control characters, or contains a symbolic
            link.
    """
    parts = [part for part in name.split("/") if part not in ("", ".")]
    reason = ""
    if not parts:
        reason = "expected the name of a file"
    elif len(os.fsencode(name)) > MAX_PATH_BYTES:
        reason = f"expected a path of at most {MAX_PATH_BYTES} bytes"
    elif ".." in parts:
        reason = "expected a path below the folder, without '..'"
    elif printable(name, len(name)) != name:
        reason = "expected a path without control characters"
    path = Path(folder)
    for part in () if reason else parts:
        path = path / part
        if path.is_symlink():
            reason = f"expected no symbolic link, got {shortened(printable(part))}"
            break
    if reason:
        raise ConfigError([Problem(str(folder), "", f"{reason}: '{shortened(printable(name))}'")])
    return path


def read_below(folder: str | Path, name: str, most_bytes: int = MAX_BYTES) -> bytes:
    """Reads the file that a foreign path inside a folder names; see `path_below`.

    Raises:
        ConfigError: If the path is invalid, or if the file is missing, too large, a symbolic link, a pipe or a device.
    """
    path = path_below(folder, name)
    try:
        return read_file(path, most_bytes)
    except OSError as error:
        raise ConfigError([Problem(str(path), "", (error.strerror or str(error)).lower())]) from None


def entries_of(folder: str | Path, most: int = MAX_ENTRIES, *, links: bool = False) -> list[os.DirEntry[str]]:
    """Returns the entries of a foreign folder, sorted by name.

    Args:
        folder: The folder.
        most: Largest allowed number of returned entries.
        links: Whether the result includes symbolic links.

    Raises:
        OSError: If the folder cannot be read, or has more than `most` entries.
    """
    found: list[os.DirEntry[str]] = []
    with os.scandir(folder) as entries:
        for entry in entries:
            if len(found) == most:
                raise OSError(errno.E2BIG, f"has more than {most} entries", str(folder))
            if links or not entry.is_symlink():
                found.append(entry)
    return sorted(found, key=lambda entry: entry.name)


def load_foreign_yaml(folder: str | Path, name: str, most_bytes: int = MAX_BYTES) -> dict[str, Any]:
    """Reads a mapping from a YAML file that a foreign path inside a folder names.

    Raises:
        ConfigError: As for `path_below` and `load_config`.
    """
    return load_config(str(path_below(folder, name)), most_bytes)


def load_foreign_json(text: str | bytes, file: str, most_bytes: int = MAX_BYTES, most_values: int = MAX_VALUES) -> Any:
    """Parses a foreign JSON text.

    Args:
        text: The text, or its bytes in UTF-8.
        file: Source of the text, for error messages.
        most_bytes: Largest length of the text.
        most_values: Largest number of values, counted over all levels.

    Raises:
        ConfigError: If the text is not JSON, is too large, or is nested more than 100 levels deep.
    """
    try:
        if len(text) > most_bytes:
            raise ValueError(f"has {len(text)} bytes, expected at most {most_bytes}")
        data = json.loads(text)
        if len(text) > min(2 * MAX_DEPTH, most_values):  # shorter texts cannot exceed the limits
            _check_size(data, most_values)
    except RecursionError:
        raise ConfigError([Problem(file, "", f"has more than {MAX_DEPTH} levels")]) from None
    except ValueError as error:  # includes invalid UTF-8 and invalid JSON
        raise ConfigError([Problem(file, "", shortened(printable(str(error), 200)))]) from None
    return data


def printable(text: str, most: int = 1000) -> str:
    """Converts a foreign text to one line that is safe for a terminal or a log.

    Control characters, such as line breaks, and characters that change the text direction are replaced by escapes such
    as `\\x1b`. A text with more than `most` characters is cut, and ends with `...`.
    """
    cut = text if len(text) <= most else f"{text[: max(most - 3, 0)]}..."
    return "".join(_escaped(each) if unicodedata.category(each) in _UNSAFE else each for each in cut)


def printable_lines(text: str) -> str:
    """Makes each line of a text safe for a terminal, see `printable`, without cutting lines."""
    return "\n".join(printable(line, len(line)) for line in text.split("\n"))


_UNSAFE = frozenset(("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"))
"""Unicode categories of unsafe characters, which a terminal or an editor may interpret as commands."""


def _escaped(character: str) -> str:
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _check_size(data: Any, most_values: int) -> None:
    """Raises a ValueError if parsed JSON has more than `most_values` values or `MAX_DEPTH` levels."""
    level, depth, count = [data], 0, 1
    while level:
        if depth > MAX_DEPTH:
            raise ValueError(f"has more than {MAX_DEPTH} levels")
        if count > most_values:
            raise ValueError(f"has more than {most_values} values")
        inner: list[Any] = []
        for each in level:
            if isinstance(each, dict):
                inner += each.values()
            elif isinstance(each, list):
                inner += each
        level, depth, count = inner, depth + 1, count + len(inner)
