"""Program of the loop's process, which the node starts: `python -m operator_node.haptics.process FD`.

Further arguments are those of a node, for devices that communicate through ROS.
"""

import gc
import signal
import socket
import sys

from operator_node.haptics.controller import HapticController
from operator_node.haptics.link import Link
from operator_node.haptics.loop import HZ, HapticLoop
from operator_node.haptics.messages import Setup

SWITCH_S = 0.0002
"""Longest time for which a thread of the device may hold Python's lock [s]; Python's default is 5 ms."""


def main() -> None:
    """Runs the loop until the node has gone, or has closed the link."""
    link = Link(socket.socket(fileno=int(sys.argv[1])))
    # The node decides when this ends; a signal to this process alone makes it send zero first
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: link.close())
    link.wait()
    setup: Setup | None = next(link.receive(), None)
    if setup is None:
        return
    sys.setswitchinterval(SWITCH_S)
    device = setup.device(setup.options)
    controller = HapticController(setup.config, setup.options, HZ, setup.way)
    gc.collect()
    gc.freeze()  # existing objects stay, so that later collections take next to no time
    HapticLoop(device, controller, setup.config, link, setup.orders).run()


if __name__ == "__main__":
    main()
