"""Shells that know nothing but one workspace, as a user's terminal does after `source setup.bash`."""

from __future__ import annotations

import os
from pathlib import Path

PATH = "/usr/local/bin:/usr/bin:/bin"
"""Other Pythons first, as on many a user's machine."""


def in_clean_shell(line: str, setup: Path | None = None) -> list[str]:
    """Returns a command that runs a line of bash in an empty environment but for the tests' ROS master and home.

    Args:
        line: What to run; an error ends it.
        setup: `setup.bash` to source before.
    """
    kept = [f"{name}={os.environ[name]}" for name in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOME", "HOME")]
    start = f"source {setup} && " if setup else ""
    return ["env", "-i", *kept, f"PATH={PATH}", "bash", "-c", f"{start}set -e; {line}"]
