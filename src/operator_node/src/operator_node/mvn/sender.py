"""Sends datagrams at given times."""

import argparse
import socket
import time
from collections.abc import Iterable

from .packets import DEFAULT_PORT

LOOPBACK = "127.0.0.1"


def send(timed: Iterable[tuple[float, bytes]], host: str, port: int) -> int:
    """Sends datagrams by UDP, each at its time [s] from now; late ones are sent at once. Returns their number.

    A missing receiver is no error.
    """
    count = 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        begin_s = time.monotonic()
        for time_s, data in timed:
            left_s = begin_s + time_s - time.monotonic()
            if left_s > 0.0:
                time.sleep(left_s)
            sender.sendto(data, (host, port))
            count += 1
    return count


def sender_arguments(program: str, purpose: str | None) -> argparse.ArgumentParser:
    """Returns a parser with the options `--host` and `--port`."""
    parser = argparse.ArgumentParser(prog=program, description=purpose)
    parser.add_argument("--host", default=LOOPBACK, help="receiver; by default this computer")
    parser.add_argument("--port", type=int, default=DEFAULT_PORT, help=f"UDP port there; by default {DEFAULT_PORT}")
    return parser


def without_ros_arguments(arguments: Iterable[str]) -> list[str]:
    """Returns the arguments of a program without those that roslaunch adds, such as `__name:=player`."""
    return [argument for argument in arguments if ":=" not in argument]
