"""The window of live_plot, which draws each joint state of a world at 1 kHz."""

from __future__ import annotations

from bench_worlds import arm_world
from result import Result, Target
from session import JOINT_STATES, PROGRAMS, Session

HZ = 1000
FIELDS = tuple(f"{JOINT_STATES}/position[{index}]" for index in range(1, 4))


def run(quick: bool) -> list[Result]:
    """Measures redraws, and the rate of the simulation seen by another subscriber; the floor is without the window."""
    seconds = 8.0 if quick else 30.0
    with Session() as ros:
        ros.simulator(arm_world(ros.folder, HZ))
        alone = ros.watch(JOINT_STATES, seconds=seconds, stock=False).arrivals()[JOINT_STATES]
        program = ["python3", "-u", str(PROGRAMS / "live_plot.py"), str(seconds), *FIELDS]
        window = ros.start(["xvfb-run", "-a", *program])
        ros.wait_for_output(window, "window")
        beside = ros.watch(JOINT_STATES, seconds=seconds, stock=False).arrivals()[JOINT_STATES]
        drawn = ros.result_of(window)
    return [
        Result("live_plot", "redraws", drawn["redraws"], "1/s", None, Target(55.0, at_least=True)),
        Result(
            "live_plot", "values drawn", drawn["values"], "1/s", None, Target(0.99 * HZ * len(FIELDS), at_least=True)
        ),
        Result("live_plot", "processor of the window", drawn["processor"], ""),
        Result("live_plot", "joint states", beside.rate_hz, "1/s", alone.rate_hz, Target(0.998 * HZ, at_least=True)),
        Result(
            "live_plot", "real-time factor", beside.real_time_factor, "", alone.real_time_factor, Target(0.995, True)
        ),
        *(Result("live_plot", f"lateness p{p}", beside.lateness_ms(p), "ms", alone.lateness_ms(p)) for p in (50, 99)),
    ]
