"""Two arms with joint states at 1 kHz amid 30 moving objects on TF."""

from __future__ import annotations

from bench_worlds import crowded_world
from loop import publisher_alone
from result import Result, Target
from session import Session

HZ = 1000
TF_HZ = 50
ARMS = ("kuka_lwr", "second")
TF = "/tf"


def run(quick: bool) -> list[Result]:
    """Measures whether 1 kHz is held, as a process sees it that takes both arms' joint states; another takes TF."""
    seconds = 8.0 if quick else 30.0
    floor = publisher_alone(HZ, seconds / 2)
    with Session() as ros:
        world = crowded_world(ros.folder, HZ)
        (arm,) = world["robots"]
        world["robots"] = [arm, {"file": arm, "name": ARMS[1], "loadURDF": {"basePosition": [-0.45, 0.0, 0.0]}}]
        ros.simulator(world)
        topics = [f"/rpbi/{name}/joint_states" for name in ARMS]
        poses = ros.watch(TF, seconds=seconds, stock=False)
        found = ros.watch(*topics, seconds=seconds, stock=False).arrivals()
        tf_hz = poses.arrivals()[TF].rate_hz
    first = found[topics[0]]
    return [
        *(
            Result("many", f"joint states of {name}", found[topic].rate_hz, "1/s", floor.rate_hz, _at_least(998))
            for name, topic in zip(ARMS, topics)
        ),
        Result("many", "real-time factor", first.real_time_factor, "", floor.real_time_factor, _at_least(0.995)),
        *(Result("many", f"lateness p{p}", first.lateness_ms(p), "ms", floor.lateness_ms(p)) for p in (50, 99)),
        Result("many", "TF messages, share of their rate", tf_hz / TF_HZ, "", None, _at_least(0.98)),
    ]


def _at_least(limit: float) -> Target:
    return Target(limit, at_least=True)
