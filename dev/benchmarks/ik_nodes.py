"""From a problem published to its joint target, through the solver node; the floor is a rospy echo of joint states."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from ik import ARMS
from result import Result, Target
from session import Session

HZ = 500
FASTEST_HZ = 1000
ROUNDS = 6
"""Echo and solver alternate, so that the load of the computer affects both equally."""
PROBLEM, TARGET = "/ik", "/joint_states/target"
SENT, ECHOED = "/sent", "/echoed"


class Answers(NamedTuple):
    """Answers to a stream of messages.

    Attributes:
        share: Share of them that was answered; of those that wait, the solver node takes the newest alone [%].
        latencies_ms: How long each took to its answer or to a newer one [ms], shape (n,).
    """

    share: float
    latencies_ms: npt.NDArray[np.float64]

    def percentile(self, percentile: float) -> float:
        """Returns a percentile of the latencies [ms]."""
        return float(np.percentile(self.latencies_ms, percentile, method="higher"))


def run(quick: bool) -> list[Result]:
    """Measures p50 and p99 of `kdl` with the LWR, and how many problems are answered themselves."""
    seconds = 1.0 if quick else 5.0
    echoes, answers = [], []
    with Session(use_sim_time=False) as ros:
        ros.program("echo", SENT, ECHOED)
        _start_solver(ros)
        for _ in range(ROUNDS):
            echoes.append(_ask(ros, SENT, ECHOED, HZ, seconds, "--joint-states"))
            answers.append(_ask(ros, PROBLEM, TARGET, HZ, seconds))
        fastest = _ask(ros, PROBLEM, TARGET, FASTEST_HZ, seconds)
    floor, found = _together(echoes), _together(answers)
    p99 = Target(3.0, of_floor=True)
    return [
        Result("ik_nodes", "problem to target p50", found.percentile(50), "ms", floor.percentile(50)),
        Result("ik_nodes", "problem to target p99", found.percentile(99), "ms", floor.percentile(99), p99),
        Result("ik_nodes", f"answered at {HZ} Hz", found.share, "%", floor.share),
        Result("ik_nodes", f"answered at {FASTEST_HZ} Hz", fastest.share, "%"),
    ]


def _start_solver(ros: Session) -> None:
    parameters = [f"_{key}:={value}" for key, value in ARMS["LWR"].options.items()]
    ros.start(["rosrun", "ik_ros", "ik_solver_node.py", "kdl", "_start_on_init:=true", *parameters])


def _ask(ros: Session, topic: str, target: str, hz: int, seconds: float, *options: str) -> Answers:
    client = ros.program("circle", topic, target, hz, round(hz * seconds), *options)
    result = ros.result_of(client)
    return Answers(100.0 * result["answered"], 1e3 * np.array(result["latencies_s"]))


def _together(rounds: list[Answers]) -> Answers:
    share = float(np.mean([one.share for one in rounds]))
    return Answers(share, np.concatenate([one.latencies_ms for one in rounds]))
