"""`mvn_player.py FILE`: sends a recorded stream of MVN with its timing."""

import sys
from collections.abc import Iterator
from pathlib import Path

from custom_ros_tools.errors import InterfaceError

from .recording import read_recording
from .sender import send, sender_arguments, without_ros_arguments

PAUSE_S = 0.02
"""Pause before a recording is repeated [s]."""


def timed_datagrams(path: Path, speed: float = 1.0, loop: bool = False) -> Iterator[tuple[float, bytes]]:
    """Yields the datagrams of a recording, each with the time at which to send it [s].

    Args:
        path: The recording.
        speed: Factor of the speed of the recording.
        loop: Whether it is repeated forever.

    Raises:
        InterfaceError: If it cannot be read, or is empty.
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
    """Runs the command; returns its exit code."""
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
