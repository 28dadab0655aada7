"""The command `shell`."""

import os
import signal
from typing import Annotated

from .argument import Argument
from .modules import workspace


def shell(*words: Annotated[str, Argument("[-c COMMAND]", is_raw=True)]) -> None:
    """Opens a shell in which the workspace is sourced, or runs one command in such a shell.

    Usage:
        ./rpbi shell [-c COMMAND]
    """
    arguments = words if words[:1] == ("-c",) else ("--rcfile", str(workspace() / "dev/tools/shell.bash"))
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # otherwise bash would inherit Python's ignored SIGPIPE
    os.execvp("bash", ["bash", *arguments])
