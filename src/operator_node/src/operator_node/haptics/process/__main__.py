"""The loop's process, a program: `python -m operator_node.haptics.process FD`; the node starts it.

Further arguments are those of a node, for devices that speak by ROS.
"""

import gc
import signal
import socket
import sys

from operator_node.haptics.controller import HapticController
from operator_node.haptics.loop import HZ, HapticLoop

from .link import Link
from .messages import Setup

SWITCH_S = 0.0002
"""How long a device's own threads may keep Python to themselves [s]; Python's default is 5 ms."""


def main() -> None:
    """Runs the loop until the node has gone, or has closed the link."""
    link = Link(socket.socket(fileno=int(sys.argv[1])))
    # The node decides when this ends; whoever ends it alone has it send zero first
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
    gc.freeze()  # what is there stays, so that collecting the rest takes next to no time
    HapticLoop(device, controller, setup.config, link, setup.orders).run()


if __name__ == "__main__":
    main()
