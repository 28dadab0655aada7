"""An hour at 1 kHz with camera, contacts and a controller: is the rate kept, and does memory stay constant?

It takes an hour, so it runs only when it is named; `--quick` takes a minute.
"""

from __future__ import annotations

from bench_worlds import CAMERA, crowded_world
from result import Result, Target
from session import Session

HZ = 1000
STATUS_HZ = 50.0
ROBOT, JOINT = "kuka_lwr", "lwr_arm_1_joint"
SECONDS, QUICK_SECONDS = 3600.0, 60.0
LARGEST_GROWTH = 0.02
SILENCE_S = 0.5
"""Time without a status after which monitors consider a simulator dead."""


def run(quick: bool, seconds: float | None = None) -> list[Result]:
    """Measures memory and received messages from beginning to end.

    Args:
        quick: Whether a minute will do.
        seconds: How long instead [s].
    """
    seconds = seconds or (QUICK_SECONDS if quick else SECONDS)
    with Session() as ros:
        ros.place_camera()
        ros.simulator(crowded_world(ros.folder, HZ, count=5, rgbd_sensor=CAMERA, status_hz=STATUS_HZ))
        found = ros.result_of(ros.program("soak", seconds, ROBOT, JOINT), timeout_s=1.2 * seconds + 120.0)
    wall_s, gaps_s = found["wall_s"], found["longest_gaps_s"]
    growth = [
        Result("soak", f"memory growth, {name}", share, "", None, Target(LARGEST_GROWTH))
        for name, share in found["growth"].items()
    ]
    return [
        Result("soak", "time", wall_s, "s"),
        *growth,
        *(Result("soak", f"memory, {name}", mb, "MB") for name, mb in found["memory_mb"].items()),
        Result("soak", "threads and files", found["new_handles"], "more", None, Target(0)),
        Result("soak", "statuses received, share of their rate", found["statuses"] / wall_s / STATUS_HZ, ""),
        Result("soak", "longest time without a status", gaps_s["statuses"], "s", None, Target(SILENCE_S)),
        Result("soak", "joint states received", found["joint_states"] / wall_s, "1/s"),
        Result("soak", "images received", found["images"] / wall_s, "1/s"),
    ]
