"""The command `setup`."""

import sys
from typing import Annotated

from .argument import Argument


def setup(*extras: Annotated[str, Argument("[EXTRA ...]", offers="extras")]) -> None:
    """Installs and builds missing parts of the workspace, which every other command also does before it starts.

    Args:
        EXTRA: optional part to install and to keep up to date: ik, mpc, planning, tags, data, gym, farm, html, assets,
            site, notebook, foxglove, ros2, identify, mujoco or wheel; see docs/installation.md
    """
    print("Ready.", file=sys.stderr)  # the program `rpbi` has already installed and built everything
