"""The command `shell`."""

import os
import shlex
import signal
from typing import Annotated

from .argument import Argument, UsageError
from .modules import workspace


def shell(*words: Annotated[str, Argument("[-c COMMAND]", is_raw=True)]) -> None:
    """Opens a shell in which the workspace is sourced, or runs one command in such a shell.

    Usage:
        ./rpbi shell [-c COMMAND]
    """
    if words and words[0] != "-c":
        raise UsageError(
            f"expected -c before a command, got {words[0]!r}: ./rpbi shell -c {shlex.quote(shlex.join(words))}"
        )
    arguments = words if words else ("--rcfile", str(workspace() / "dev/tools/shell.bash"))
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # otherwise bash would inherit Python's ignored SIGPIPE
    os.execvp("bash", ["bash", *arguments])
