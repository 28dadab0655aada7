"""Services and topics of the nodes import nothing that the nodes were not started with."""

from __future__ import annotations

import os
import subprocess
import sys

from ik_nodes import CHAIN, HOME, problem, start_node
from ros_system import support_on_path

from ik_ros.msg import TaskGoal
from ik_ros.srv import SolveIK

SOLVER = "asked_solver:AskedSolver"
BY_ITSELF = f"""
from ik_ros.lookup import make_solver
from ik_ros.problem import IKProblem
make_solver("{SOLVER}", {CHAIN}).solve(IKProblem(goals={{"canary:Canary": (1.0,)}}))
"""


def test_a_class_that_a_problem_names_is_not_imported(ros, tmp_path, monkeypatch):
    sung = tmp_path / "sung"
    (tmp_path / "canary.py").write_text(f"open({str(sung)!r}, 'w')\n")
    path = os.pathsep.join((support_on_path()["PYTHONPATH"], str(tmp_path)))
    monkeypatch.setenv("PYTHONPATH", path)
    services = "ik/solver/asked_solver/AskedSolver"
    start_node(ros, "ik_solver_node.py", SOLVER, f"{services}/solve", **CHAIN)

    asked = problem(HOME)

    def ask(*names: str):
        asked.goals = [TaskGoal(name, [1.0]) for name in names]
        return ros.call(f"{services}/solve", SolveIK, asked)

    answer = ask("canary:Canary")
    assert not answer.success and "'canary:Canary' is not trusted, so it is not imported: " in answer.message
    assert not sung.exists()
    assert ask().success and ask(SOLVER).success, "what it was started with is trusted"

    subprocess.run([sys.executable, "-c", BY_ITSELF], capture_output=True, timeout=60.0)
    assert sung.exists(), "without the node, the same solver imports it"
