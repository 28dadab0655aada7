"""A setup node reports the solver that does not answer it."""

from __future__ import annotations

import os
import signal

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from ik_nodes import start_setup, start_solver
from ros_system import wait_until


@pytest.mark.thorough
def test_a_stopped_and_a_killed_solver_are_reported(ros):
    diagnostics = ros.listen("/diagnostics", DiagnosticArray)
    solver = start_solver(ros)
    setup = start_setup(ros, goals={"reach": [0.0]}, hz=20.0)

    def status() -> DiagnosticStatus:
        return next(each for each in diagnostics.messages[-1].status if each.name == "/ik_setup_node: solver")

    wait_until(lambda: status().message == "/ik_solver_node", "it answers")
    assert status().level == DiagnosticStatus.OK
    os.kill(solver.pid, signal.SIGSTOP)
    stopped = f"/ik_solver_node is stopped or hangs: no solution of {rospy.resolve_name('ik')} for 5 s"
    wait_until(lambda: status().message == stopped, "it is reported")
    assert status().level == DiagnosticStatus.WARN
    os.kill(solver.pid, signal.SIGCONT)
    wait_until(lambda: status().level == DiagnosticStatus.OK, "it answers again")
    os.kill(solver.pid, signal.SIGKILL)
    wait_until(lambda: "/ik_solver_node has ended or is switched off" in status().message, "its end is reported")
    assert stopped in ros.output(setup) and "/ik_solver_node answers again" in ros.output(setup)
