"""Opens the window of live_plot for some seconds and prints its rates. Arguments: seconds, fields."""

from __future__ import annotations

import json
import sys
import time

from PyQt5.QtCore import QTimer

from custom_ros_tools.program import run
from rpbi_utils.live_plot import live_plot_node as node

WARM_UP_S = 3.0


def main() -> None:
    """Runs the program as `rosrun rpbi_utils live_plot` does."""
    seconds = float(sys.argv.pop(1))
    show = node._show

    def show_measured(opened: tuple) -> None:
        window = opened[-1]
        before: list[float] = []

        def begin() -> None:
            before.extend((time.monotonic(), time.process_time(), window.canvas.redraws, window.plot.count))
            print("window", flush=True)

        def end() -> None:
            passed = time.monotonic() - before[0]
            measured = {
                "redraws": (window.canvas.redraws - before[2]) / passed,
                "values": (window.plot.count - before[3]) / passed,
                "processor": (time.process_time() - before[1]) / passed,
            }
            print(f"result: {json.dumps(measured)}", flush=True)
            window.close()

        QTimer.singleShot(int(1e3 * WARM_UP_S), begin)
        QTimer.singleShot(int(1e3 * (WARM_UP_S + seconds)), end)
        show(opened)

    node._show = show_measured
    node.main()


if __name__ == "__main__":
    run("live_plot:main")
