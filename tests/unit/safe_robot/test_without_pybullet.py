"""The guard decides where PyBullet is not installed: it measures distances by hpp-fcl."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

KUKA = Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf"
GUARD = """
import sys
sys.modules["pybullet"] = sys.modules["pybullet_data"] = None  # importing one raises ImportError
from robot_model.geometry import Pose
from safe_robot.check import CheckContext
from safe_robot.config import GuardConfig
from robot_model.collision.shapes import Obstacle
from safe_robot.guard import Guard
from robot_model.model import RobotModel

options = {"start_from": "target", "start_tolerance": 10.0, "checks": {"environment": {}}}
guard = Guard(GuardConfig.parse(options, "guard.yaml"), RobotModel(sys.argv[1]), "guard.yaml")
home, folded = (0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0), (1.0, 2.09, -2.9, 1.7, -0.5, -2.09, -1.3)
pole = Obstacle("pole", "cylinder", (0.1, 0.1, 2.0), Pose((-0.5, 0.6, 1.0)))
wall = Obstacle("wall", "box", (0.2, 2.0, 2.0), Pose((0.0, 0.0, 0.8)))
guard.start()
assert guard.decide(home, CheckContext(obstacles=(pole,))).command == home
print(guard.decide(tuple(each + 1e-4 for each in home), CheckContext(obstacles=(wall,))).violation)
folding = Guard(GuardConfig.parse(options, "guard.yaml"), RobotModel(sys.argv[1]), "guard.yaml")
folding.start()
there = dict(zip(folding.joint_names, home))
print(folding.decide(folded, CheckContext(obstacles=(), measured=there)).violation)
assert not any(name == "rpbi" or name.startswith("rpbi.") for name in sys.modules)
"""


def test_the_guard_decides_without_pybullet():
    pytest.importorskip("hppfcl")
    command = [sys.executable, "-c", GUARD, str(KUKA)]
    done = subprocess.run(command, capture_output=True, text=True, env={"PYTHONPATH": ":".join(sys.path)})
    assert done.returncode == 0, done.stderr
    in_wall, folded = done.stdout.splitlines()
    assert in_wall.startswith("environment: link 'lwr_arm_") and "'wall': distance is -" in in_wall
    assert folded.startswith("self_collision: links 'lwr_arm_0_link' and 'end_effector_sponge': distance is ")
