"""Readers of folders of episodes, each tried in a fork that reports writes outside and foreign modules."""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from custom_ros_tools.console.modules import command_of
from custom_ros_tools.plugins import trust_only
from robustness.hostile_bags.trial import Trial, tried
from rpbi_data import episodes_to_dataframes
from rpbi_data.episodes.folder import EpisodeFolder
from rpbi_data.episodes.verified_messages import verify

from .makers import Hostile

FOREIGN = ("canary_module", "antigravity", "this")
"""Modules that hostile folders name."""
MAX_MEMORY_MB = 2000.0
"""Most memory of a reader of a folder [MB]."""
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGES = {
    "os.mkdir": 1,
    "os.rename": 2,
    "os.remove": 1,
    "os.rmdir": 1,
    "os.symlink": 2,
    "os.link": 2,
    "os.truncate": 1,
}
"""Audited calls that change files, with the number of their paths."""


def _command(name: str, *words: str) -> Callable[[Path], None]:
    def run(demos: Path) -> None:
        command = command_of(f"rpbi_data.console.{name}")
        assert command is not None
        sys.exit(command.run([str(demos), *words]))

    return run


def _verify(demos: Path) -> None:
    trust_only({"rpbi"}, "--trust")
    verdict = verify(EpisodeFolder(demos), 0)
    print(verdict.text)
    sys.exit(not verdict.is_same)


READERS: dict[str, Callable[[Path], object]] = {
    "episodes": _command("episodes"),
    "episodes --show": _command("episodes", "--show", "0"),
    "episodes_to_dataframes": episodes_to_dataframes,
    "verify": _verify,
    "view": _command("view", "0", "--out", "out.html"),
    **{
        f"export --to {name}": _command("export", "--to", name, "--out", name)
        for name in ("lerobot", "robomimic", "mcap")
    },
    "episodes --relabel": _command("episodes", "--relabel", "0", "other"),
    "episodes --repair": _command("episodes", "--repair"),
    "episodes --discard": _command("episodes", "--discard", "0"),
}
"""Readers by name, in the order in which they are tried: the last ones write into the folder."""


def trials(hostile: Hostile, readers: dict[str, Callable[[Path], object]] = READERS) -> Iterator[tuple[str, Trial]]:
    """Yields the outcome of each reader of a folder; its verdict is also `outside` or `code`."""
    for name, read in readers.items():
        before = _content(hostile.outside)
        trial = tried(lambda path, read=read: _watched(read, path), hostile.demos)
        canary = hostile.demos.parent / "canary"
        if canary.exists():
            said = canary.read_text()
            canary.unlink()
            trial = trial._replace(verdict=said.split()[0], said=said)
        elif _content(hostile.outside) != before:
            trial = trial._replace(verdict="outside", said="the folder outside has changed")
        yield name, trial


def is_fine(trial: Trial) -> bool:
    """Whether a folder was taken or refused, within the limits of time and memory."""
    return trial.is_fine and trial.memory_mb <= MAX_MEMORY_MB


def _content(folder: Path) -> list[tuple[Any, ...]]:
    found: list[tuple[Any, ...]] = []
    for path in sorted(folder.rglob("*")):
        status = path.lstat()
        content = path.read_bytes() if path.is_file() and not path.is_symlink() else b""
        found.append((str(path), status.st_mode, status.st_mtime_ns, content))
    return found


def _watched(read: Callable[[Path], object], demos: Path) -> None:
    """Reads a folder; writes outside of it, and foreign modules, are recorded in a file `canary` next to it."""
    inside = demos.parent
    temporary = inside / "temporary"
    temporary.mkdir(exist_ok=True)
    tempfile.tempdir = str(temporary)
    os.environ["TMPDIR"] = str(temporary)
    sys.path.insert(0, str(inside))  # as that of a command in the folder
    code = 'import pathlib\npathlib.Path(__file__).with_name("canary").write_text("code canary_module")\nclass X: ...\n'
    (inside / "canary_module.py").write_text(code)
    roots = tuple(map(os.path.realpath, (inside, os.environ["XDG_CACHE_HOME"])))
    sys.dont_write_bytecode = True  # Python's cache is no effect of the folder
    is_noting = False

    def note(words: str) -> None:
        nonlocal is_noting
        is_noting = True
        with contextlib.suppress(OSError):
            (inside / "canary").write_text(words)
        is_noting = False

    def check(path: Any) -> None:
        if isinstance(path, (str, bytes, os.PathLike)):
            name = os.fsdecode(path)
            real = os.path.join(os.path.realpath(os.path.dirname(name) or "."), os.path.basename(name))
            if not real.startswith(roots) and not real.startswith("/dev/"):
                note(f"outside {real}")

    def watch(event: str, arguments: tuple[Any, ...]) -> None:
        if is_noting:
            return
        if event == "import" and str(arguments[0]).partition(".")[0] in FOREIGN:
            note(f"code {arguments[0]}")
        elif event == "open" and isinstance(arguments[2], int) and arguments[2] & _WRITES:
            if isinstance(arguments[0], (str, bytes, os.PathLike)) and os.path.islink(arguments[0]):
                check(os.path.realpath(arguments[0]))
            check(arguments[0])
        elif event in _CHANGES:
            for path in arguments[: _CHANGES[event]]:
                check(path)

    sys.addaudithook(watch)
    read(demos)
