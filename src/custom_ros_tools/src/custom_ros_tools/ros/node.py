"""What the programs of nodes call; it imports nothing that starts a thread."""

from __future__ import annotations

import pkgutil
import signal


def run(main: str) -> None:
    """Runs a node's main function with Ctrl-C held back for `custom_ros_tools.ros.lifecycle.run_node`.

    A signal can be held back only before the process has its first thread, and libraries start theirs when they are
    imported; so the function is imported here.

    Args:
        main: The function, as `module:function`.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    pkgutil.resolve_name(main)()
