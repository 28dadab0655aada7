"""Entry point of the renderer process: `python -m rpbi.render --socket FD --sink module:factory`.

The simulator starts this process. The sink reads further arguments from `sys.argv`.
"""

import argparse
import logging
import signal
import socket

from custom_ros_tools.plugins import find

from .channel import Channel
from .process import RenderProcess, ReportHandler


def main() -> None:
    """Runs the renderer process until the simulator closes the connection or ends."""
    parser = argparse.ArgumentParser(prog="rpbi.render")
    parser.add_argument("--socket", type=int, required=True, help="file descriptor of the connection")
    parser.add_argument("--sink", required=True, help="module:factory of the receiver of frames")
    parser.add_argument("--keep-priority", action="store_true", help="do not yield to the simulator")
    arguments, _ = parser.parse_known_args()
    # Ctrl-C goes to the whole process group; the simulator decides when this process ends.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    channel = Channel(socket.socket(fileno=arguments.socket))
    logger = logging.getLogger("rpbi")
    logger.setLevel(logging.INFO)
    logger.propagate = False
    logger.addHandler(ReportHandler(channel))
    RenderProcess(channel, lambda: find(arguments.sink)(), not arguments.keep_priority).run()


if __name__ == "__main__":
    main()
