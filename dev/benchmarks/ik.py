"""Share of reachable poses that inverse kinematics solvers reach, their times, and jumps of joints along a path."""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import pybullet_data
import PyKDL
from result import Result, Target

from custom_ros_tools.errors import MissingDependency
from ik_ros.chain.kdl import Goal
from ik_ros.lookup import make_solver
from ik_ros.problem import IKProblem
from ik_ros.solver import Solver
from ik_ros.solvers.kdl import KdlSolver
from rpbi.geometry import Pose

POSES, QUICK_POSES = 1000, 100
GLOBAL_PART = 0.05
"""Share of the poses for `global`, which tries all its starts for each."""
NEAR = 0.1
"""Standard deviation of near starts [rad]."""
PATH_STEPS, PATH_RADIUS_M = 1000, 0.1
DATA = Path(pybullet_data.getDataPath())
LWR = Path(__file__).resolve().parents[2] / "src/rpbi_examples/robots/kuka_lwr.urdf"


class Arm(NamedTuple):
    """A robot.

    Attributes:
        urdf: Its description.
        base: The link that poses are in.
        tip: The link that goes there.
        elbow: A posture with a bent elbow, the far start [rad].
    """

    urdf: Path
    base: str
    tip: str
    elbow: Sequence[float]

    @property
    def options(self) -> dict[str, Any]:
        """Options of solvers for its tip."""
        return {"urdf_filename": str(self.urdf), "base_link": self.base, "tip_link": self.tip}

    @property
    def task_options(self) -> dict[str, Any]:
        """Options of `tasks` for the same problem."""
        pose = {"name": "tip", "type": "frame_pose", "frame": self.tip, "required": True}
        return {"urdf_filename": str(self.urdf), "base_frame": self.base, "costs": [pose]}


ELBOW = (0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0)
ARMS = {
    "LWR": Arm(LWR, "lwr_arm_0_link", "end_effector_ball", ELBOW),
    "iiwa": Arm(DATA / "kuka_iiwa/model.urdf", "lbr_iiwa_link_0", "lbr_iiwa_link_7", ELBOW),
    "Panda": Arm(DATA / "franka_panda/panda.urdf", "panda_link0", "panda_hand", (*ELBOW[:5], 1.6, 0.0)),
    "xArm6": Arm(DATA / "xarm/xarm6_robot.urdf", "link_base", "link6", (0.0, -0.5, -0.5, 0.0, 0.8, 0.0)),
}
SOLVERS = ("kdl", "trac_ik", "pybullet", "tasks", "global")
REACHED = {"kdl": 99.5, "trac_ik": 99.5, "tasks": 99.0}
"""Share of the poses to reach with arms of 7 joints [%]."""
MEAN_MS = {("LWR", "kdl"): 0.5, ("LWR", "trac_ik"): 0.5, ("LWR", "tasks"): 1.5, ("iiwa", "tasks"): 1.5}
"""Time that a pose may take on average from a far start [ms]."""


def run(quick: bool) -> list[Result]:
    """Measures all solvers with all arms; the floor is one bare call of KDL, which may fail and exceed limits.

    Args:
        quick: Whether to use only a tenth of the poses.
    """
    results = []
    for arm_name, arm in ARMS.items():
        kdl = make_solver("kdl", arm.options)
        assert isinstance(kdl, KdlSolver)
        sets = {start: _problems(kdl, arm, start, QUICK_POSES if quick else POSES) for start in ("far", "near")}
        floor = _mean_ms(_bare(kdl), sets["far"])
        for name in SOLVERS:
            try:
                solver = make_solver(name, arm.task_options if name == "tasks" else arm.options)
            except MissingDependency as error:
                print(f"    {name}: {error}")
                continue
            results += _measure(solver, f"{name}, {arm_name}", sets, floor, partial(_targets, name, arm_name, arm))
            jump, reached = _path(kdl, solver, arm, PATH_STEPS // 10 if name == "global" else PATH_STEPS)
            figure = f"{name}, {arm_name}, path"
            results.append(Result("ik", f"{figure}: reached", reached, "%"))
            results.append(Result("ik", f"{figure}: largest joint jump", jump, "rad"))
    return results


def _targets(name: str, arm_name: str, arm: Arm, start: str) -> tuple[Target | None, Target | None]:
    """Returns the target share of reached poses, and the target time."""
    share = REACHED.get(name) if len(arm.elbow) == 7 else None
    mean_ms = MEAN_MS.get((arm_name, name)) if start == "far" else None
    return Target(share, at_least=True) if share else None, Target(mean_ms) if mean_ms else None


def _measure(
    solver: Solver,
    what: str,
    sets: dict[str, list[IKProblem]],
    floor: float,
    targets: Callable[[str], tuple[Target | None, Target | None]],
) -> list[Result]:
    results = []
    for start, problems in sets.items():
        if what.startswith("global"):
            problems = problems[: max(1, int(GLOBAL_PART * len(problems)))]
        solver.solve(problems[0])
        solved: list[bool] = []
        mean = _mean_ms(lambda problem: solved.append(solver.solve(problem).success), problems)  # noqa: B023
        share, time_target = targets(start)
        results.append(Result("ik", f"{what}, {start}: reached", 100.0 * sum(solved) / len(solved), "%", target=share))
        results.append(Result("ik", f"{what}, {start}: mean", mean, "ms", floor, time_target))
    return results


def _problems(kdl: KdlSolver, arm: Arm, start: str, count: int) -> list[IKProblem]:
    """Returns reachable poses, the same every time, from the posture with a bent elbow or from near a solution."""
    generator = random.Random(1)
    problems = []
    for _ in range(count):
        q = kdl.limits.random(generator, kdl.limits.middle)
        near = kdl.limits.clip([position + generator.gauss(0.0, NEAR) for position in q])
        begin = dict(zip(kdl.joint_names, arm.elbow if start == "far" else near))
        problems.append(IKProblem(target=kdl.chain.pose(q), start=begin))
    return problems


def _path(kdl: KdlSolver, solver: Solver, arm: Arm, steps: int) -> tuple[float, float]:
    """Follows a circle from the posture with a bent elbow.

    Returns:
        The largest jump of a joint from one step to the next [rad], and how many of them were reached [%].
    """
    (x, y, z), quat_xyzw = kdl.chain.pose(arm.elbow)
    q: Sequence[float] = arm.elbow
    jump, reached = 0.0, 0
    for step in range(steps):
        angle = 2.0 * math.pi * step / steps
        centre = Pose((x, y + PATH_RADIUS_M * math.sin(angle), z + PATH_RADIUS_M * (math.cos(angle) - 1.0)), quat_xyzw)
        solution = solver.solve(IKProblem(target=centre, start=dict(zip(solver.joint_names, q))))
        if solution.success:
            jump = max(jump, *(abs(a - b) for a, b in zip(solution.positions, q)))
            q, reached = solution.positions, reached + 1
    return jump, 100.0 * reached / steps


def _bare(kdl: KdlSolver) -> Callable[[IKProblem], object]:
    """Returns a bare call of the library that `kdl` uses."""
    bare = PyKDL.ChainIkSolverPos_LMA(kdl.chain.kdl)
    begin, end = PyKDL.JntArray(len(kdl.joint_names)), PyKDL.JntArray(len(kdl.joint_names))

    def solve(problem: IKProblem) -> object:
        for index, position in enumerate(problem.start.values()):
            begin[index] = position
        return bare.CartToJnt(begin, Goal(problem).frame, end)

    return solve


def _mean_ms(solve: Callable[[IKProblem], object], problems: Sequence[IKProblem]) -> float:
    start_s = time.perf_counter()
    for problem in problems:
        solve(problem)
    return 1e3 * (time.perf_counter() - start_s) / len(problems)
