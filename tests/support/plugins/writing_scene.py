"""A scene for tests: a KUKA LWR4+ leads the tip of its tool along a line."""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np

from robot_model.geometry import Pose, minus, norm, plus
from rpbi_examples.scenes.parts.arm import LedArm
from rpbi_examples.scenes.scene import Scene, Watched

WAY = (0.0, 0.1, 0.05)
TOLERANCE_M = 0.005
BEGUN = "WRITING_BEGUN"
"""Variable that names a file in which each scene that is made leaves a line."""


class Writing(Scene):
    """Leads the tip along a line of random length."""

    world = "{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml"
    watch = Watched(robots=("kuka_lwr",))
    longest_s = 5.0

    def __init__(self, random: np.random.Generator) -> None:
        super().__init__(random)
        if BEGUN in os.environ:
            with open(os.environ[BEGUN], "a") as file:
                file.write("begun\n")

    def act(self) -> Iterator[None]:
        self._arm = LedArm(self, "kuka_lwr", "{rpbi_examples}/robots/kuka_lwr.urdf", "base", "end_effector_ball")
        length = self.random.uniform(0.5, 1.0)
        goal = plus(self._arm.target.position, tuple(length * each for each in WAY))
        self._goal = Pose(goal, self._arm.target.quat_xyzw)
        yield from self._arm.go(self._goal, 1.5)
        yield from self.wait(0.5)

    def has_succeeded(self) -> bool:
        return hasattr(self, "_goal") and self._error() < TOLERANCE_M

    def figures(self) -> dict[str, float]:
        return {"error [mm]": 1e3 * self._error()} if hasattr(self, "_goal") else {}

    def _error(self) -> float:
        return norm(minus(self._arm.pose().position, self._goal.position))
