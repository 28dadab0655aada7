"""Runs a farm on a Ray cluster of two nodes, one of which is killed; then one whose head is killed.

Its arguments are a folder and the words of the first farm, whose episodes go to `farm` there. Those of the second go to
`lost`, and what it prints to `lost.txt`.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
CONSOLE = (sys.executable, str(ROOT / "devel/lib/custom_ros_tools/console"))
PR_SET_CHILD_SUBREAPER = 36
"""Has processes whose parent has ended become children of this one, see prctl(2)."""
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"


def main() -> None:
    """Runs both."""
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1)
    folder, words = Path(sys.argv[1]), sys.argv[2:]
    with tempfile.TemporaryDirectory(prefix="rpbi-ray-") as place:
        os.environ["RAY_TMPDIR"] = place
        from ray.cluster_utils import Cluster

        options = {"num_cpus": 1, "include_dashboard": False, "object_store_memory": 80_000_000}
        cluster = Cluster(initialize_head=True, head_node_args=options)
        try:
            node = cluster.add_node(num_cpus=1, object_store_memory=80_000_000)
            command = [*CONSOLE, *words, "--address", cluster.address]
            farm = _started(command, folder / "farm", 2, sys.stderr)
            cluster.remove_node(node, allow_graceful=False)
            if farm.wait(120.0):
                sys.exit(farm.returncode)
            command[command.index("--out") + 1] = str(folder / "lost")
            with open(folder / "lost.txt", "w") as text:
                farm = _started(command, folder / "lost", 1, text)
                cluster.head_node.kill_gcs_server()
                if farm.wait(60.0) != 1:
                    sys.exit(f"expected the exit code 1 without the head of the cluster, got {farm.returncode}")
        finally:
            cluster.shutdown()
            _end_rest()


def _end_rest() -> None:
    """Ends the agents of nodes that were killed, which would notice that only later."""
    while orphans := Path(f"/proc/self/task/{os.getpid()}/children").read_text().split():
        for orphan in map(int, orphans):
            os.kill(orphan, signal.SIGKILL)
            os.waitpid(orphan, 0)


def _started(command: list[str], folder: Path, count: int, out: object) -> subprocess.Popen[bytes]:
    """Starts a farm, and returns when some of its episodes are there."""
    farm = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT)
    while len(list(folder.glob("episode_*"))) < count:
        if farm.poll() is not None:
            sys.exit(f"the farm has ended before {count} episodes were there: exit code {farm.returncode}")
        time.sleep(0.02)
    return farm


if __name__ == "__main__":
    main()
