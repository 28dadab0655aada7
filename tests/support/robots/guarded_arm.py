"""Robots for the tests of the guard, and an oracle that judges it from outside."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from robot_model.model import RobotModel
from safe_robot.check import Check, CheckContext
from safe_robot.config import GuardConfig
from safe_robot.guard import Decision, Guard

KUKA = str(Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf")
HOME = (0.0, 0.5, 0.0, -1.2, 0.0, 0.8, 0.0)
PERIOD_S = 0.01
LIMITS = {"velocity": 1.0, "acceleration": 8.0, "jerk": 200.0}
SLIDER = """<robot name="slider"><link name="base"/><link name="cart"/><link name="hand"/><link name="tool"/>
  <joint name="mount" type="fixed"><parent link="hand"/><child link="tool"/></joint>
  <joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="2"/></joint>
  <joint name="turn" type="revolute"><parent link="cart"/><child link="hand"/><origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="3"/></joint>
</robot>"""
"""A robot without shapes: a cart, and a hand that turns on it."""

FOLDING = """<robot name="folding">
  <link name="base"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
  <link name="upper">
    <collision><origin xyz="0.2 0 0"/><geometry><box size="0.3 0.06 0.06"/></geometry></collision></link>
  <link name="lower">
    <collision><origin xyz="0.25 0 0"/><geometry><box size="0.4 0.06 0.06"/></geometry></collision></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="1" velocity="3"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><axis xyz="0 0 1"/>
    <origin xyz="0.4 0 0"/><limit lower="-3" upper="3" effort="1" velocity="3"/></joint>
</robot>"""
"""Two boxes on a box: the second one meets the first, the lower one the base, when the elbow folds."""


class BrokenCheck(Check):
    """A check that raises."""

    name = "broken"
    watches = True

    def check(self, motion, context):
        """See `Check`."""
        raise ZeroDivisionError


def folding(folder: Path) -> RobotModel:
    """Returns the robot that can fold itself into itself."""
    path = folder / "folding.urdf"
    path.write_text(FOLDING)
    return RobotModel(str(path))


def slider(folder: Path) -> RobotModel:
    """Returns the robot without shapes."""
    path = folder / "slider.urdf"
    path.write_text(SLIDER)
    return RobotModel(str(path))


def guard_of(robot: RobotModel, start: bool = True, **config: Any) -> Guard:
    """Returns a guard that takes targets from where the first one is."""
    options = {"period_s": PERIOD_S, "start_from": "target", "limits": LIMITS, **config}
    guard = Guard(GuardConfig.parse(options, "guard.yaml"), robot, "guard.yaml")
    if start:
        guard.start()
    return guard


def decide(guard: Guard, target: Sequence[float], **context: Any) -> Decision:
    """Returns the decision on a target in an ordinary context."""
    return guard.decide(tuple(target), CheckContext(**context))


def worst_shares(commands: Sequence[Sequence[float]], limits: dict[str, float], period_s: float) -> dict[str, float]:
    """Returns the largest share of each limit that commands have, by differences; the robot stands before the first."""
    rows = np.array([commands[0]] * 3 + list(commands), dtype=float)
    shares = {}
    for order, key in enumerate(("velocity", "acceleration", "jerk"), start=1):
        shares[key] = float(np.abs(np.diff(rows, order, axis=0)).max()) / period_s**order / limits[key]
    return shares
