"""Files and texts from untrusted sources: paths that stay inside a folder, size limits, and text that is safe on a
terminal.

All code that reads an episode, a saved world, a data set or a message of another node uses these functions.
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
"""Longest path that a foreign file may name [bytes]; PyBullet copies paths into 1024 bytes."""
MAX_DEPTH = 100
"""Largest depth of nested lists and mappings in a foreign JSON text."""
MAX_ENTRIES = 100_000
"""Largest number of entries of a foreign folder that are read."""


def path_below(folder: str | Path, name: str) -> Path:
    """Returns the path that a foreign file names, in a folder and never outside of it.

    Args:
        folder: The folder; it is trusted, and may be a symbolic link itself.
        name: The foreign path. An absolute path is taken relative to the folder: `/a/b` becomes `FOLDER/a/b`.

    Raises:
        ConfigError: If the path is empty, too long, has `..` or control characters, or passes a symbolic link.
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
    """Returns the content of a file that a foreign file names, see `path_below`.

    Raises:
        ConfigError: If the path leaves the folder, or if the file is missing, is too large, or is a link, pipe or
            device.
    """
    path = path_below(folder, name)
    try:
        return read_file(path, most_bytes)
    except OSError as error:
        raise ConfigError([Problem(str(path), "", (error.strerror or str(error)).lower())]) from None


def entries_of(folder: str | Path, most: int = MAX_ENTRIES, *, links: bool = False) -> list[os.DirEntry[str]]:
    """Returns the entries of a foreign folder in the order of their names.

    Args:
        folder: The folder.
        most: Largest number of its entries.
        links: Whether symbolic links are among them.

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
    """Returns the mapping in a YAML file below a folder.

    Raises:
        ConfigError: As `read_below` and `load_config` do.
    """
    return load_config(str(path_below(folder, name)), most_bytes)


def load_foreign_json(text: str | bytes, file: str, most_bytes: int = MAX_BYTES, most_values: int = MAX_VALUES) -> Any:
    """Returns the value of a JSON text.

    Args:
        text: The text, in UTF-8 if it is bytes.
        file: Its source, for messages.
        most_bytes: Largest length of the text.
        most_values: Largest number of values, of all levels together.

    Raises:
        ConfigError: If it is no JSON, too large, or nested in more than 100 levels.
    """
    try:
        if len(text) > most_bytes:
            raise ValueError(f"has {len(text)} bytes, expected at most {most_bytes}")
        data = json.loads(text)
        if len(text) > min(2 * MAX_DEPTH, most_values):  # a shorter one has fewer levels and values
            _check_size(data, most_values)
    except RecursionError:
        raise ConfigError([Problem(file, "", f"has more than {MAX_DEPTH} levels")]) from None
    except ValueError as error:  # includes invalid UTF-8 and invalid JSON
        raise ConfigError([Problem(file, "", shortened(printable(str(error), 200)))]) from None
    return data


def printable(text: str, most: int = 1000) -> str:
    """Returns a foreign text in one line for a terminal or a log.

    Control characters (line breaks and escape sequences among them) and characters that change the direction of the
    text become `\\x1b` and the like; a text of more than `most` characters is cut and ends with `...`.
    """
    cut = text if len(text) <= most else f"{text[: max(most - 3, 0)]}..."
    return "".join(_escaped(each) if unicodedata.category(each) in _UNSAFE else each for each in cut)


def printable_lines(text: str) -> str:
    """Returns a text whose lines are all safe for a terminal, see `printable`; none is cut."""
    return "\n".join(printable(line, len(line)) for line in text.split("\n"))


_UNSAFE = frozenset(("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"))
"""Unicode categories of characters that a terminal or an editor may act on."""


def _escaped(character: str) -> str:
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _check_size(data: Any, most_values: int) -> None:
    """Raises a ValueError if there are too many values, or too many levels."""
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
