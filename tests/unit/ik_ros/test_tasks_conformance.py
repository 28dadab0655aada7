"""The solvers `tasks`, `exotica` and `trajectory`, held to the conformance suite."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import pybullet_data

from ik_ros.conformance import SolverConformance
from robot_model.geometry import Pose
from robot_model.model import RobotModel

IIWA = str(Path(pybullet_data.getDataPath()) / "kuka_iiwa/model.urdf")
LWR = str(Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf")
PANDA = str(Path(pybullet_data.getDataPath()) / "franka_panda/panda.urdf")


class TestTasksWithIiwa(SolverConformance):
    solver_name = "tasks"
    options = {
        "urdf_filename": IIWA,
        "costs": [{"name": "reach", "type": "frame_pose", "frame": "lbr_iiwa_link_7"}],
    }
    reachable_problems = 200
    random_problems = 100
    tip_link = "lbr_iiwa_link_7"

    def forward(self, positions: Sequence[float]) -> Pose:
        at = dict(zip(self.solver.joint_names, positions))
        return self.robot.pose([at.get(name, 0.0) for name in self.robot.joint_names], self.tip_link)


class TestTasksWithConstraintOnPanda(TestTasksWithIiwa):
    options = {
        "urdf_filename": PANDA,
        "joints": [f"panda_joint{i}" for i in range(1, 8)],
        "constraints": [{"name": "reach", "type": "frame_pose", "frame": "panda_hand"}],
    }
    tip_link = "panda_hand"


class TestTrajectoryWithIiwa(SolverConformance):
    solver_name = "trajectory"
    options = {
        "urdf_filename": IIWA,
        "base_link": "lbr_iiwa_link_0",
        "tip_link": "lbr_iiwa_link_7",
        "duration_s": 5.0,
    }
    least_share = 0.9
    reachable_problems = 20
    random_problems = 30


class TestExoticaWithLwr(SolverConformance):
    solver_name = "exotica"
    options = {"xml_filename": "{rpbi_examples}/configs/kuka_lwr_ik_example/exotica.xml"}
    reachable_problems = 100
    random_problems = 50

    @cached_property
    def robot(self) -> RobotModel:
        return RobotModel(LWR)

    def forward(self, positions: Sequence[float]) -> Pose:
        at = dict(zip(self.solver.joint_names, positions))
        return self.robot.pose([at.get(name, 0.0) for name in self.robot.joint_names], "end_effector_ball")
