"""Reads a bag with one reader in its own process, and measures the result."""

from __future__ import annotations

import contextlib
import io
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from custom_ros_tools.console.modules import command_of
from custom_ros_tools.errors import InterfaceError
from rpbi_data import bag_to_dataframes, topic_report
from rpbi_data.bags import bag_to_table_node as bag_to_table

LONGEST_S = 60.0
"""Processor time; a process that takes more, or ten times this on the clock, is ended by signal 9."""
MAX_MEMORY = 4 * 2**30
_ENDS_AT = 10 * 2**30


class Trial(NamedTuple):
    """Outcome of a reader.

    Attributes:
        verdict: `taken`, `refused`, or what must not be: `signal N`, `traceback`, `silent` or `code`.
        said: The end of its output.
        cpu_s: Processor time [s].
        memory_mb: Most memory that it had at once, with Python and all libraries.
    """

    verdict: str
    said: str
    cpu_s: float
    memory_mb: float

    @property
    def is_fine(self) -> bool:
        is_small = self.cpu_s <= LONGEST_S and self.memory_mb * 1e6 <= MAX_MEMORY
        return self.verdict in ("taken", "refused") and is_small


def _to_files(path: Path, kind: str) -> None:
    images = ["--images"] if kind == "parquet" else []
    sys.exit(bag_to_table.main([str(path), "--quiet", "--format", kind, "--out", str(path.parent / kind), *images]))


READERS: dict[str, Callable[[Path], object]] = {
    "topic_report": topic_report,
    "bag_to_dataframes": lambda path: bag_to_dataframes(path, images=True),
    "bag_to_table, Parquet": lambda path: _to_files(path, "parquet"),
    "bag_to_table, CSV": lambda path: _to_files(path, "csv"),
    "replay": lambda path: sys.exit(command_of("rpbi_data.console.replay").run([str(path), "--quiet"])),
}
"""Readers of bags by name; a refusal is an InterfaceError, or an exit with 1 and a message on stderr or stdout."""


def tried(read: Callable[[Path], object], path: Path) -> Trial:
    """Reads a bag in a fork of this process; code in the bag makes a file `canary` next to it."""
    with tempfile.TemporaryFile() as said:
        sys.stdout.flush()
        sys.stderr.flush()
        child = os.fork()
        if not child:
            _read_and_exit(read, path, said.fileno())
        end_s = time.monotonic() + 10 * LONGEST_S
        while True:
            ended, status, usage = os.wait4(child, os.WNOHANG)
            if ended:
                break
            if time.monotonic() > end_s:
                os.kill(child, signal.SIGKILL)
            time.sleep(0.005)
        said.seek(0)
        words = said.read().decode(errors="replace")
    verdict = {0: "taken", 1: "refused"}.get(os.waitstatus_to_exitcode(status), "traceback")
    if os.WIFSIGNALED(status):
        verdict = f"signal {os.WTERMSIG(status)}"
    elif "Traceback" in words:
        verdict = "traceback"
    elif verdict == "refused" and not words.strip():
        verdict = "silent"
    if (path.parent / "canary").exists():
        verdict = "code"
    return Trial(verdict, words[-1500:], usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1e3)


def _read_and_exit(read: Callable[[Path], object], path: Path, saying: int) -> None:
    code = 2
    try:
        os.chdir(path.parent)
        os.dup2(saying, 1)
        os.dup2(saying, 2)
        sys.stdout = sys.stderr = io.TextIOWrapper(io.FileIO(saying, "w", closefd=False), write_through=True)
        resource.setrlimit(resource.RLIMIT_CPU, (int(LONGEST_S) + 1, int(LONGEST_S) + 1))
        resource.setrlimit(resource.RLIMIT_AS, (_ENDS_AT, _ENDS_AT))
        read(path)
        code = 0
    except InterfaceError as error:
        print(str(error)[:4000])
        code = 1
    except SystemExit as end:
        code = {None: 0, 0: 0, 1: 1}.get(end.code, code)
    except BaseException:
        print(traceback.format_exc()[-4000:])
    finally:
        with contextlib.suppress(Exception):
            sys.stdout.flush()
        os._exit(code)
