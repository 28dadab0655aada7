"""A ROS master that shuts down no node by mistake.

A master tells the former owner of a node's name to end, by the address that it had, also if it ended long ago: rospy
does not take leave of all that it told the master. By then the port may be that of another node, perhaps of another
worker's, which would end for no reason that anybody could find.
"""

from __future__ import annotations

import os
import threading
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import rosmaster
from rosmaster import registrations

ANSWER_S = 60.0
"""So long a node that was asked who it is may take to answer; one that takes longer hangs, and is not shut down."""
SCRIPT = "#!/usr/bin/python3\nimport sys\n\nsys.path.insert(0, {!r})\nimport careful_master\n\ncareful_master.main()\n"


def path_with(folder: Path) -> str:
    """Returns a PATH on which programs find this master, written to a folder, in the place of ROS's own."""
    folder.mkdir(parents=True, exist_ok=True)
    script = folder / "rosmaster"
    script.write_text(SCRIPT.format(str(Path(__file__).parent)))
    script.chmod(0o755)
    return os.pathsep.join((str(folder), os.environ["PATH"]))


def main() -> None:
    """Runs the master."""
    manager = registrations.RegistrationManager
    register, shut_down = manager._register_node_api, registrations.shutdown_node_task
    processes: dict[tuple[str, str], Future[str | None]] = {}

    def register_and_remember(self: Any, caller_id: str, caller_api: str) -> Any:
        known = (caller_id, caller_api)
        if known not in processes:
            processes[known] = process = Future()
            asking = threading.Thread(target=lambda: process.set_result(_process_at(caller_api)), daemon=True)
            asking.start()
        return register(self, caller_id, caller_api)

    def shut_down_the_same(api: str, caller_id: str, reason: str) -> None:
        before = processes[caller_id, api].result(ANSWER_S)
        if before is not None and before == _process_at(api):
            shut_down(api, caller_id, reason)

    manager._register_node_api, registrations.shutdown_node_task = register_and_remember, shut_down_the_same
    rosmaster.rosmaster_main()


def _process_at(api: str) -> str | None:
    """Returns a text that only the process that answers at an address has, None if no node does."""
    try:
        answer: Any = registrations.xmlrpcapi(api).getPid("/master")
        return f"{answer[2]} since {Path(f'/proc/{answer[2]}/stat').read_text().rsplit(')', 1)[1].split()[19]}"
    except Exception:  # whatever is there instead of a node may answer anything
        return None
