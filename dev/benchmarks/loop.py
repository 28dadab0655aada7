"""Joint states at the rate of the loop, as received by another process, compared with a bare rospy publisher."""

from __future__ import annotations

from arrivals import Arrivals
from bench_worlds import arm_world
from result import Result, Target
from session import JOINT_STATES, Session


def run(quick: bool) -> list[Result]:
    """Measures rate, real-time factor and lateness at 200 Hz and 1 kHz."""
    seconds = 5.0 if quick else 20.0
    return _at(200, seconds) + _at(1000, seconds, Target(998, at_least=True), Target(0.995, at_least=True))


def publisher_alone(hz: float, seconds: float) -> Arrivals:
    """Returns the joint states that a subscriber receives from a bare rospy publisher."""
    with Session(use_sim_time=False) as ros:
        ros.program("publish", JOINT_STATES, hz)
        return ros.watch(JOINT_STATES, seconds=seconds).arrivals()[JOINT_STATES]


def _at(hz: int, seconds: float, rate: Target | None = None, factor: Target | None = None) -> list[Result]:
    floor = publisher_alone(hz, seconds)
    with Session() as ros:
        ros.simulator(arm_world(ros.folder, hz))
        found = ros.watch(JOINT_STATES, seconds=seconds).arrivals()[JOINT_STATES]
    at = f"at {hz} Hz"
    return [
        Result("loop", f"joint states received {at}", found.rate_hz, "1/s", floor.rate_hz, rate),
        Result("loop", f"real-time factor {at}", found.real_time_factor, "", floor.real_time_factor, factor),
        *(Result("loop", f"lateness p{p} {at}", found.lateness_ms(p), "ms", floor.lateness_ms(p)) for p in (50, 99)),
    ]
