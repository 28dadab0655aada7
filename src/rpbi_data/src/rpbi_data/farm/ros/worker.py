"""Entry point of a process that makes episodes: `python -m rpbi_data.farm.ros.worker FD`."""

import signal
import sys
from multiprocessing.connection import Connection

from custom_ros_tools.errors import InterfaceError
from rpbi_data.episodes.folder import EpisodeFolder
from rpbi_data.farm.job import EpisodeOutcome

from .maker import EpisodeMaker


def main() -> None:
    """Makes the requested episodes until the other end is closed."""
    connection = Connection(int(sys.argv[1]))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that started it
    job, path = connection.recv()
    folder = EpisodeFolder(path)
    try:
        maker = EpisodeMaker(job)
    except InterfaceError as error:
        connection.send(EpisodeOutcome(-1, fault=str(error), stops=True))
        return
    while True:
        try:
            number = connection.recv()
        except EOFError:
            return
        connection.send(maker.make(folder, number))


if __name__ == "__main__":
    main()
