"""Reads hostile files in processes with limits, and returns the results."""

from __future__ import annotations

import contextlib
import faulthandler
import json
import logging
import os
import resource
import select
import shutil
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from custom_ros_tools.errors import InterfaceError

from .readers import REFUSALS, hostile

LONGEST_S = 60.0
"""Time that all readers of a file may take together [s]."""
MAX_BYTES = 4 * 2**30
"""Memory that a process may take."""
MAX_BATCH = 100
"""Number of files that one process reads, unless it ends before."""


class Outcome(NamedTuple):
    """Outcome of a reader of a file.

    Attributes:
        seed: The file's seed.
        reader: Its name.
        verdict: `taken` or `refused`; else what must not be: `signal N`, `traceback`, `hang`, `silent` or `code`.
        seconds: Wall time that it took.
        text: What it said.
    """

    seed: int
    reader: str
    verdict: str
    seconds: float
    text: str

    @property
    def is_fine(self) -> bool:
        """Whether the file was accepted or refused, as by a correct reader."""
        return self.verdict in ("taken", "refused")


def outcomes(kind: str, seeds: range, folder: Path) -> Iterator[Outcome]:
    """Yields the outcome of each reader of the hostile files of a kind."""
    waiting = list(seeds)
    while waiting:
        done = 0
        for outcome in _of_batch(kind, waiting[:MAX_BATCH], folder):
            if outcome.reader == "all":
                done += 1
                continue
            yield outcome
        waiting = waiting[max(done, 1) :]


def _of_batch(kind: str, seeds: list[int], folder: Path) -> Iterator[Outcome]:
    """Yields the outcomes of files in a process, up to the first that ends it; `all` is the last one of a file."""
    reading, writing = os.pipe()
    sys.stdout.flush()
    child = os.fork()
    if not child:
        os.close(reading)
        _read_all(kind, seeds, folder, writing)
    os.close(writing)
    seed, reader, text = seeds[0], "making", b""
    began_s = time.monotonic()
    while True:
        ready, _, _ = select.select([reading], [], [], LONGEST_S)
        part = os.read(reading, 1 << 16) if ready else None
        if not part:
            break
        *lines, text = (text + part).split(b"\n")
        for line in lines:
            seed, reader, *rest = json.loads(line)
            if rest:
                yield Outcome(seed, reader, *rest)
            began_s = time.monotonic()
    os.close(reading)
    if part is None:
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    if part is None or os.WIFSIGNALED(status):
        verdict = "hang" if part is None or os.WTERMSIG(status) == signal.SIGXCPU else f"signal {os.WTERMSIG(status)}"
        yield Outcome(seed, reader, verdict, time.monotonic() - began_s, "")
        yield Outcome(seed, "all", "", 0.0, "")


def _read_all(kind: str, seeds: list[int], folder: Path, report: int) -> None:
    """Reads files, writes a line before each reader and one with its outcome, and ends the process."""
    faulthandler.disable()  # which pytest has enabled: a signal is a result here, not a fault of the test
    try:
        for limit, most in ((resource.RLIMIT_AS, MAX_BYTES), (resource.RLIMIT_CORE, 0)):
            resource.setrlimit(limit, (most, most))
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nowhere, stream)
        logging.disable(logging.CRITICAL)
        warnings.simplefilter("ignore")
        for seed in seeds:
            place = folder / f"{kind}{seed}"
            shutil.rmtree(place, ignore_errors=True)
            place.mkdir()
            os.chdir(place)
            is_fine = True
            for name, read in hostile(kind, seed, place)[1].items():
                _tell(report, seed, name)
                outcome = _outcome(seed, name, read, place / "canary")
                is_fine &= outcome.is_fine
                _tell(report, *outcome)
            if is_fine:
                shutil.rmtree(place)
            _tell(report, seed, "all", "", 0.0, "")
    except BaseException:
        _tell(report, seed, "making", "traceback", 0.0, traceback.format_exc()[-3000:])
        _tell(report, seed, "all", "", 0.0, "")
    os._exit(0)


def _outcome(seed: int, name: str, read: object, canary: Path) -> Outcome:
    began_s = time.monotonic()
    verdict, text = "taken", ""
    try:
        read()  # type: ignore[operator]
    except REFUSALS as error:
        verdict, text = "refused", str(error)[:2000]
        if not text.strip():
            verdict = "silent"
        elif name in ("world", "file") and not isinstance(error, InterfaceError):
            verdict, text = "traceback", traceback.format_exc()[-3000:]
    except BaseException:
        verdict, text = "traceback", traceback.format_exc()[-3000:]
    with contextlib.suppress(OSError):
        if canary.exists():
            verdict = "code"
    return Outcome(seed, name, verdict, time.monotonic() - began_s, text)


def _tell(report: int, *line: object) -> None:
    os.write(report, json.dumps(line).encode() + b"\n")
