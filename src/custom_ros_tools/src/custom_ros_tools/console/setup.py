"""The command `setup`."""

import sys
from typing import Annotated

from .argument import Argument


def setup(*extras: Annotated[str, Argument("[EXTRA ...]", offers="extras")]) -> None:
    """Installs and builds missing parts, as every command does first.

    Args:
        EXTRA: ik, mpc, tags, data, gym, farm, html, assets, site or notebook, which stays wanted; see
            docs/installation.md
    """
    print("Ready.", file=sys.stderr)  # the program `rpbi` has already installed and built everything
