"""A ROS master that shuts down nobody else's nodes.

A master tells the former owner of a node's name to end, by the address that it had. Workers run at the same time, and
by then the port may be that of a node of another worker, which would end for no reason that anybody could find.
"""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

import rosmaster
from rosmaster import registrations

SCRIPT = "#!/usr/bin/python3\nimport sys\n\nsys.path.insert(0, {!r})\nimport careful_master\n\ncareful_master.main()\n"


def path_with(folder: Path) -> str:
    """Returns a PATH on which `roscore` finds this master, written to a folder, in the place of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    script = folder / "rosmaster"
    script.write_text(SCRIPT.format(str(Path(__file__).parent)))
    script.chmod(0o755)
    return os.pathsep.join((str(folder), os.environ["PATH"]))


def main() -> None:
    """Runs the master."""
    shut_down = registrations.shutdown_node_task

    def shut_down_own(api: str, caller_id: str, reason: str) -> None:
        if _is_ours(api):
            shut_down(api, caller_id, reason)

    registrations.shutdown_node_task = shut_down_own
    rosmaster.rosmaster_main()


def _is_ours(api: str) -> bool:
    """Tells whether what answers at an address is a process that was started with the URI of this master."""
    port = sys.argv[sys.argv.index("-p") + 1]
    try:
        answer: Any = registrations.xmlrpcapi(api).getPid("/master")
        environment = Path(f"/proc/{answer[2]}/environ").read_bytes()
    except Exception:  # whatever is there instead of a node may answer anything
        return False
    return re.search(rf"(^|\0)ROS_MASTER_URI=[^\0]*:{port}/?(\0|$)", environment.decode(errors="replace")) is not None
