"""What the programs of nodes call; it imports nothing that starts a thread."""

import pkgutil
import signal


def run(main: str) -> None:
    """Runs a node's `module:function` with Ctrl-C held back for `custom_ros_tools.ros.lifecycle.run_node`.

    A signal can be held back only before the process has its first thread, and libraries start theirs when they are
    imported; so the function is imported here.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    pkgutil.resolve_name(main)()
