"""Entry point of a process that keeps a copy of a world and forks the copy on request: `python -m rpbi.follower FD`.

FD is the file descriptor of a connection to the process that runs the world.
"""

from __future__ import annotations

import sys
from multiprocessing.connection import Connection

from rpbi.world.forks.following import serve
from rpbi.world.saved.state import WorldState

from .world import World


def main() -> None:
    """Receives the state of a world, builds a copy of the world, and answers requests until the connection ends."""
    connection = Connection(int(sys.argv[1]))
    state: WorldState = connection.recv()
    serve(connection, lambda: World.from_state(state, trust=None, max_ticks=state.tick))


if __name__ == "__main__":
    main()
