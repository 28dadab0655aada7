"""The controls window with a world at 1 kHz: time from clicks and drags to their effect, and lost joint states."""

from __future__ import annotations

from bench_worlds import arm_world
from result import Result, Target
from session import JOINT_STATES, Session
from virtual_screen import virtual_screen

HZ = 1000
SLIDER = "slider lwr_arm_0_joint"
CLICKS, DRAGS, QUICK = 50, 25, 4
LONGEST_MS = 100.0
FIGURES = {
    "clicks": "Start and Stop: click to the world's reaction",
    "shown": "Start and Stop: click to the other button",
    "drags": "slider: drag to Send",
    "sends": "Send: click to the command in the world",
}


def run(quick: bool) -> list[Result]:
    """Uses the window by mouse, by events of the X server, from a process that receives all joint states."""
    clicks, drags = (QUICK, QUICK) if quick else (CLICKS, DRAGS)
    with virtual_screen(1000, 800) as display, Session() as ros:
        ros.simulator(arm_world(ros.folder, HZ))
        window = ros.program("controls", SLIDER, "_view:=false", DISPLAY=display)
        ros.wait_for_output(window, "places")
        person = ros.program("clicks", ros.output_file(window), JOINT_STATES, clicks, drags, DISPLAY=display)
        found = ros.result_of(person)
    results = []
    for name, figure in FIGURES.items():
        times = sorted(1e3 * each for each in found[name])
        for statistic, value in (("median", times[len(times) // 2]), ("longest", times[-1])):
            results.append(Result("controls", f"{figure}, {statistic}", value, "ms", None, Target(LONGEST_MS)))
    figure = f"joint states lost, of {found['received']}"
    return [*results, Result("controls", figure, found["lost"], "", None, Target(0.0))]
