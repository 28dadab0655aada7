"""Problems that follow each other go on from where the last one led, and never from what was made up."""

from __future__ import annotations

import numpy as np
import pytest

from custom_ros_tools.errors import UnknownNameError
from ik_ros.problem import IKProblem, IKSolution
from ik_ros.problem_stream import JointRateLimiter, JointRateLimiterConfig, ProblemStream
from ik_ros.solver import Solver

JOINTS = ("shoulder", "elbow")
SPEED = 2.0
MAX_PERIOD_S = 0.05


class Asked(Solver):
    """Finds what the goal `at` says, and notes where it was to start."""

    deterministic = True
    joint_names, lower, upper, velocity_limits, base_frame = JOINTS, (-1.0, -1.0), (1.0, 1.0), (SPEED, SPEED), "base"

    def __init__(self):
        self.starts = []

    def solve(self, problem):
        unknown = set(problem.start) - {*JOINTS, "finger"}
        if unknown:
            raise UnknownNameError("joint", unknown.pop(), JOINTS)
        self.starts.append(dict(problem.start))
        at = problem.goals.get("at")
        return IKSolution(at is not None, "as asked", JOINTS, tuple(at or (0.0, 0.0)))


@pytest.fixture
def solver():
    return Asked()


@pytest.fixture
def smooth(solver):
    config = JointRateLimiterConfig(max_period_s=MAX_PERIOD_S)
    return ProblemStream(solver, JointRateLimiter(config, JOINTS, solver.velocity_limits))


def at(*positions, **start):
    return IKProblem(goals={"at": positions}, start=start)


def test_joints_without_a_start_begin_where_the_last_solution_was(solver):
    stream = ProblemStream(solver)
    stream.solve(at(0.3, 0.4))
    stream.solve(at(0.5, 0.6))
    stream.solve(at(0.7, 0.8, elbow=-0.1))
    stream.solve(at(0.7, 0.8, finger=0.02))
    assert solver.starts == [
        {},
        {"shoulder": 0.3, "elbow": 0.4},
        {"shoulder": 0.5, "elbow": -0.1},
        {"shoulder": 0.7, "elbow": 0.8, "finger": 0.02},
    ]


def test_a_failure_leads_nowhere(solver):
    stream = ProblemStream(solver)
    stream.solve(at(0.3, 0.4))
    assert not stream.solve(IKProblem()).success
    stream.solve(at(0.5, 0.6))
    assert solver.starts[-1] == {"shoulder": 0.3, "elbow": 0.4}


def test_continuity_begins_at_the_first_start_within_joint_velocities(solver, smooth):
    first = smooth.solve(at(0.5, 0.0, shoulder=-0.5, elbow=0.2), 10.0)
    assert first.positions == (-0.5, 0.2) and "0% of the motion" in first.message
    second = smooth.solve(at(0.5, 0.0, shoulder=0.9, elbow=0.9), 10.01)
    assert second.positions == pytest.approx((-0.5 + 0.01 * SPEED, 0.2 - 0.2 * 0.01 * SPEED))
    assert solver.starts[1] == {"shoulder": -0.5, "elbow": 0.2}, "where the last target was, whatever is measured"
    after_a_pause = smooth.solve(at(0.5, 0.0), 60.0)
    assert after_a_pause.positions[0] - second.positions[0] == pytest.approx(MAX_PERIOD_S * SPEED)


def test_continuity_begins_within_limits(smooth):
    assert smooth.solve(at(0.5, 0.0, shoulder=-7.0, elbow=1.2), 1.0).positions == (-1.0, 1.0)


def test_continuity_refuses_a_start_that_lacks_joints(solver, smooth):
    for start in ({"finger": 0.02}, {"shoulder": 0.4}):
        with pytest.raises(ValueError, match=r"start: continuity begins there.* lacks .*elbow"):
            smooth.solve(at(0.5, 0.5, **start), 1.0)
    with pytest.raises(UnknownNameError, match="elbw"):
        smooth.solve(at(0.5, 0.5, shoulder=0.4, elbow=0.4, elbw=0.4), 1.0)
    assert smooth.solve(at(0.5, 0.5, shoulder=0.4, elbow=0.4), 1.0).positions == (0.4, 0.4)


def test_without_any_start_continuity_begins_at_the_first_solution(smooth):
    assert smooth.solve(at(0.5, -0.5), 1.0).positions == (0.5, -0.5)


def test_a_restarted_stream_begins_at_the_next_start(smooth):
    for stamp_s in (1.0, 1.1, 1.2):
        smooth.solve(at(0.5, 0.0, shoulder=0.0, elbow=0.0), stamp_s)
    smooth.restart()
    assert smooth.target is None
    assert smooth.solve(at(0.5, 0.0, shoulder=0.1, elbow=-0.3), 1.3).positions == (0.1, -0.3)
    smooth.restart()
    assert smooth.solve(at(0.5, -0.5), 1.4).positions == (0.5, -0.5), "without a start"


@pytest.mark.parametrize("hold", [True, False])
def test_hold_continues_to_the_last_target_without_a_solution(solver, hold):
    config = JointRateLimiterConfig(hold=hold)
    stream = ProblemStream(solver, JointRateLimiter(config, JOINTS, solver.velocity_limits))
    nowhere = IKProblem()
    stream.solve(nowhere, 1.0)
    assert stream.target is None  # nothing to go on to yet
    stream.solve(at(0.0, 0.0), 1.0)
    stream.solve(at(0.3, 0.0), 1.1)
    targets = [stream.target]
    for stamp_s in (1.12, 1.14, 1.16, 1.18):
        assert not stream.solve(nowhere, stamp_s).success
        targets.append(stream.target)
    if hold:
        assert np.allclose(targets, [(0.2, 0.0), (0.24, 0.0), (0.28, 0.0), (0.3, 0.0), (0.3, 0.0)])
        assert solver.starts[-1] == dict(zip(JOINTS, targets[-2]))
    else:
        assert targets[1:] == [None] * 4
