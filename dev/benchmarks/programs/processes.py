"""Memory and handles of the processes of nodes."""

from __future__ import annotations

import os
from pathlib import Path
from xmlrpc.client import ServerProxy

import rosgraph

CALLER = "/benchmarks"


def process_of(node: str) -> int:
    """Returns the number of a node's process."""
    _, _, process_id = ServerProxy(rosgraph.Master(CALLER).lookupNode(node)).getPid(CALLER)
    return int(process_id)  # type: ignore[call-overload]


def memory_mb(process_id: int) -> float:
    """Returns the memory that a process has to itself or shares with others [MB]."""
    pages = int(Path(f"/proc/{process_id}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def handles(process_id: int) -> int:
    """Returns how many threads and open files a process has together."""
    folder = Path(f"/proc/{process_id}")
    return len(os.listdir(folder / "task")) + len(os.listdir(folder / "fd"))
