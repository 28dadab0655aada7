"""Entry point of a process that follows a world and forks itself: `python -m rpbi.follower FD`."""

from __future__ import annotations

import sys
from multiprocessing.connection import Connection

from rpbi.world.forks.following import serve
from rpbi.world.saved.state import WorldState

from .world import World


def main() -> None:
    """Follows the world whose state is received first."""
    connection = Connection(int(sys.argv[1]))
    state: WorldState = connection.recv()
    serve(connection, lambda: World.from_state(state, trust=None, max_ticks=state.tick))


if __name__ == "__main__":
    main()
