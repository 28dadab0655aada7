"""roslaunch or `./rpbi launch`, whose nodes come from the process that it was forked from itself; see `forked_node`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any

import roslaunch
from forked_node import PACKAGES, ForkedNode, run_script, split_server
from roslaunch import nodeprocess


def start(
    command: list[str],
    *,
    stdout: IO[str] | None,
    stderr: IO[str] | None,
    cwd: str,
    env: dict[str, str],
    **options: Any,
) -> subprocess.Popen:
    """Starts a node as roslaunch would, those of this workspace as forks."""
    if Path(command[0]).parent.name not in PACKAGES:
        return subprocess.Popen(command, stdout=stdout, stderr=stderr, cwd=cwd, env=env, **options)
    return ForkedNode(command, stdout.fileno() if stdout else 1, stderr.fileno() if stderr else 2, env, cwd)


def main() -> None:
    """Runs the command of the arguments; in each of its nodes, runs the node."""
    command = split_server()
    if command:
        run_script(command)
        return
    nodeprocess.subprocess = SimpleNamespace(**{**vars(subprocess), "Popen": start})
    del sys.argv[0]
    if sys.argv[0] == "roslaunch":
        roslaunch.main()
    else:
        from rpbi_examples.console.launch import launch  # few tests need it

        sys.exit(launch(*sys.argv[2:]))


if __name__ == "__main__":
    main()
