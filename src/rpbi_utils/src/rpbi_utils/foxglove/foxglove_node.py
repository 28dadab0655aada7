"""`foxglove_node.py`: shows a ROS system in Foxglove or Lichtblick, which need no ROS."""

from __future__ import annotations

import argparse
import ctypes
import sys
from functools import partial

import rospy

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.run_node import run_node

NAME = "foxglove"
PORT = 8765
"""Port that Foxglove and Lichtblick suggest."""
M_MMAP_THRESHOLD, LARGE_BYTES = -3, 512 * 1024
"""Option of the C library (malloc.h), and size of messages whose memory returns to the system when they are freed.

By default, this size grows up to 32 MB, and the memory of smaller messages stays with the process.
"""


def main() -> None:
    """Runs the node. Exits with 1 if the port is in use, before it registers and so ends a node of its name."""
    ctypes.CDLL(None).mallopt(M_MMAP_THRESHOLD, LARGE_BYTES)
    arguments = _parser().parse_args(rospy.myargv(sys.argv)[1:])
    try:
        from .bridge_node import FoxgloveNode
        from .viewer_server import check_address

        check_address(arguments.host, arguments.port)
    except InterfaceError as error:
        sys.exit(f"{NAME}: {error}")
    run_node(NAME, partial(FoxgloveNode, arguments.host, arguments.port), ros_time=False)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="foxglove_node.py", description="Shows a ROS system in Foxglove or Lichtblick."
    )
    parser.add_argument("--host", default="127.0.0.1", help="address to listen at; default: this computer only")
    parser.add_argument("--port", type=int, default=PORT, help=f"default: {PORT}")
    return parser
