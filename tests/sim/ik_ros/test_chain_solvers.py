"""Every solver of one link's pose, held to the conformance suite with arms of 7 and 6 joints."""

from __future__ import annotations

from pathlib import Path

import pybullet_data
import pytest

from ik_ros.conformance import SolverConformance
from ik_ros.problem import IKProblem, IKSolution
from ik_ros.solver import Solver
from ik_ros.solvers.kdl import KdlConfig

DATA = Path(pybullet_data.getDataPath())
ROBOTS = Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots"
LONG_TIMEOUT = {"timeout": 0.2}
"""TRAC-IK counts wall time, which is short on a busy computer."""


def _arm(urdf: Path, base_link: str, tip_link: str) -> dict[str, object]:
    return {"urdf_filename": str(urdf), "base_link": base_link, "tip_link": tip_link}


LWR = _arm(ROBOTS / "kuka_lwr.urdf", "lwr_arm_0_link", "end_effector_ball")
IIWA = _arm(DATA / "kuka_iiwa/model.urdf", "lbr_iiwa_link_0", "lbr_iiwa_link_7")
PANDA = _arm(DATA / "franka_panda/panda.urdf", "panda_link0", "panda_hand")
XARM6 = _arm(DATA / "xarm/xarm6_robot.urdf", "link_base", "link6")


class TestKdlWithLwr(SolverConformance):
    solver_name = "kdl"
    options = LWR
    least_share = 0.995
    reachable_problems = 400


class TestKdlWithIiwa(TestKdlWithLwr):
    options = IIWA
    random_problems = 100


class TestKdlWithPanda(TestKdlWithIiwa):
    options = PANDA


class TestKdlWithXarm6(TestKdlWithIiwa):
    options = XARM6
    least_share = 0.99


class TestTracIkWithLwr(SolverConformance):
    solver_name = "trac_ik"
    options = {**LWR, **LONG_TIMEOUT}
    least_share = 0.995
    reachable_problems = 400
    random_problems = 10


class TestTracIkWithIiwa(TestTracIkWithLwr):
    options = {**IIWA, **LONG_TIMEOUT}


class TestTracIkWithPanda(TestTracIkWithLwr):
    options = {**PANDA, **LONG_TIMEOUT}


class TestTracIkInHaste(TestTracIkWithLwr):
    """Without time for a solution, answers are still within limits; how many are found, the machine's load decides."""

    options = {**LWR, "timeout": 0.001}
    least_share = 0.0
    random_problems = 500


class TestTracIkThatLooksForTheNearest(TestTracIkWithLwr):
    options = {**LWR, "solve_type": "Distance", "timeout": 0.02}
    least_share = 0.9
    reachable_problems = 40


class TestPybullet(SolverConformance):
    solver_name = "pybullet"
    options = LWR
    random_problems = 100


class TestGlobal(SolverConformance):
    solver_name = "global"
    options = {**LWR, "restarts": 20}
    reachable_problems = 50
    random_problems = 100


class Hopeless(Solver):
    """A user's own solver, which never finds anything."""

    Config = KdlConfig
    deterministic = True
    joint_names = ("lwr_arm_0_joint",)
    lower, upper = (-1.0,), (1.0,)
    base_frame = "lwr_arm_0_link"

    def __init__(self, config: KdlConfig) -> None:
        """Takes no options."""

    def solve(self, problem: IKProblem) -> IKSolution:
        """Gives up."""
        return IKSolution(False, "no idea", self.joint_names, (0.0,))


class OfHopeless(SolverConformance):
    solver_name = "hopeless"
    options = LWR

    def make(self) -> Solver:
        return Hopeless(KdlConfig.parse(self.options, "~"))


class OutsideLimits(Hopeless):
    def solve(self, problem: IKProblem) -> IKSolution:
        """Tells of a success outside limits."""
        return IKSolution(True, "here", self.joint_names, (1.5,))


class OfOutsideLimits(OfHopeless):
    def make(self) -> Solver:
        return OutsideLimits(KdlConfig.parse(self.options, "~"))


def test_a_solver_that_never_finds_anything_does_not_pass():
    with pytest.raises(AssertionError, match=r"only 0.0% of the reachable targets are reached"):
        OfHopeless().test_reachable_targets_are_reached()


def test_solver_that_reports_a_wrong_distance_fails_the_suite():
    with pytest.raises(AssertionError):
        OfHopeless().test_unreachable_target_returns_the_best_pose_and_its_distance()


def test_a_solver_that_leaves_limits_does_not_pass():
    with pytest.raises(AssertionError, match="outside limits"):
        OfOutsideLimits().test_answers_to_random_problems_are_finite_and_within_limits()
