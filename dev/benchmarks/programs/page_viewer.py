"""Looks at the page of the browser view as a browser does, without drawing; or stalls."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[3] / "tests/support/screens"))
from viewer import Viewer  # noqa: E402

SETTLE_S = 1.0


class CountingViewer(Viewer):
    """Counts the poses that it receives, by the node of the scene."""

    def __init__(self, link: str, is_reading: bool) -> None:
        self.poses: Counter[str] = Counter()
        super().__init__(link, is_reading=is_reading)

    def _apply(self, message: dict[str, Any]) -> None:
        super()._apply(message)
        if message["type"] == "SetOrientationMessage":
            self.poses[message["name"]] += 1


def main() -> None:
    """Waits for a body, prints `ready`, and prints rates of frames and bytes as JSON at the end.

    The rate of frames is that of the poses of the link that moves in most of them.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("link")
    parser.add_argument("body", help="name of a body to wait for")
    parser.add_argument("seconds", type=float)
    parser.add_argument("--stalled", action="store_true", help="connect, and read nothing")
    arguments = parser.parse_args()
    start_s = time.monotonic()
    with CountingViewer(arguments.link, not arguments.stalled) as viewer:
        if arguments.stalled:
            print("ready", flush=True)
            time.sleep(arguments.seconds)
            return
        viewer.wait(lambda: any("Mesh" in str(node.get("type")) for name, node in list(viewer.nodes.items())
                                if name.startswith(f"/{arguments.body}/")))  # fmt: skip
        first_s = time.monotonic() - start_s
        print("ready", flush=True)
        time.sleep(SETTLE_S)
        before, before_bytes = viewer.poses.copy(), viewer.bytes
        time.sleep(arguments.seconds)
        seen = viewer.poses - before
        frames = max(seen.values(), default=0) / arguments.seconds
        kilobytes = (viewer.bytes - before_bytes) / 1000 / arguments.seconds
    print("result:", json.dumps({"first_s": first_s, "frames_hz": frames, "kB/s": kilobytes}))


if __name__ == "__main__":
    main()
