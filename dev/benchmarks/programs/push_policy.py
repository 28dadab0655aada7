"""A policy that pushes the box of `basic_example_kuka_lwr`, for the benchmark of farms."""

from __future__ import annotations

import numpy as np

from rpbi.world import World
from rpbi_data.farm import Policy


class Push(Policy):
    """Swings the arm against a box at a random place, which succeeds if the box is pushed far enough."""

    def __init__(self, world: World, rng: np.random.Generator) -> None:
        super().__init__(world, rng)
        place = (rng.uniform(-0.15, -0.05), rng.uniform(-0.2, -0.15), 0.06)
        world.act("box", "teleport", (place, (0.0, 0.0, 0.0, 1.0)))
        self._swing = rng.uniform(0.5, 0.9)

    def act(self) -> str | None:
        """Moves the target, and looks at the box."""
        if self.world.clock.tick % 10 == 0:
            angle = self._swing * min(self.world.clock.time_s, 1.0)
            self.world.put("kuka_lwr/target", {"lwr_arm_0_joint": angle, "lwr_arm_1_joint": 0.65})
        return "success" if self.world.bodies["box"].base_pose().position[1] < -0.22 else None
