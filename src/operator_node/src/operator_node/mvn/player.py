"""`mvn_player.py FILE`: sends a recorded stream of MVN with the recorded timing."""

import argparse
import socket
import sys
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from custom_ros_tools.errors import InterfaceError

from .packets import DEFAULT_PORT
from .recording import read_recording

LOOPBACK = "127.0.0.1"
PAUSE_S = 0.02
"""Pause before a recording is repeated [s]."""


def send(timed: Iterable[tuple[float, bytes]], host: str, port: int) -> int:
    """Sends datagrams by UDP, and returns their number. It is not an error if nobody receives them.

    Args:
        timed: Datagrams, each with the time from now at which to send it [s]. Late datagrams are sent at once.
        host: Address of the receiver.
        port: UDP port of the receiver.
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


def timed_datagrams(path: Path, speed: float = 1.0, loop: bool = False) -> Iterator[tuple[float, bytes]]:
    """Yields the datagrams of a recording, each with the time at which to send it [s].

    Args:
        path: File of the recording.
        speed: Playback speed as a multiple of the recorded speed.
        loop: Whether to repeat the recording without end.

    Raises:
        InterfaceError: If the recording cannot be read, or is empty.
    """
    begin_s = time_s = 0.0
    count = 0
    while True:
        for time_in_file_s, data in read_recording(path):
            time_s = begin_s + time_in_file_s / speed
            yield time_s, data
            count += 1
        if not count:
            raise InterfaceError(f"{path}: the recording is empty")
        if not loop:
            return
        begin_s = time_s + PAUSE_S


def main() -> int:
    """Runs the command and returns its exit code."""
    parser = sender_arguments("mvn_player.py", __doc__)
    parser.add_argument("file", type=Path, metavar="FILE", help="recording of mvn_node.py")
    parser.add_argument("--speed", type=float, default=1.0, help="factor of the recorded speed")
    parser.add_argument("--loop", action="store_true", help="repeat until Ctrl-C")
    options = parser.parse_args(without_ros_arguments(sys.argv[1:]))
    if not 0.01 <= options.speed <= 100.0:
        parser.error(f"--speed: expected 0.01 to 100, got {options.speed:g}")
    try:
        datagrams = timed_datagrams(options.file.expanduser(), options.speed, options.loop)
        count = send(datagrams, options.host, options.port)
    except InterfaceError as error:
        print(f"mvn_player: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"mvn_player: cannot send to {options.host}:{options.port}: {error}", file=sys.stderr)
        return 1
    print(f"sent {count} datagrams to {options.host}:{options.port}")
    return 0
