"""A haptic controller with a hand on the handle, in virtual time."""

from __future__ import annotations

from collections.abc import Callable

from operator_node.haptics.config import ForceFeedbackConfig
from operator_node.haptics.controller import HapticController
from operator_node.haptics.device import HapticConfig, HapticReading
from operator_node.haptics.emulated import Hand
from robot_model.geometry import ZERO, Vector

DT_S = 0.001
DEVICE = HapticConfig(max_force_n=10.0, workspace_m=0.1)


class Rig:
    """Ticks of 1 ms, in which device and simulator say something or are silent.

    Args:
        config: Options of the controller.
    """

    def __init__(self, **config: object) -> None:
        self.controller = HapticController(ForceFeedbackConfig(**config), DEVICE, 1.0 / DT_S)
        self.hand = Hand()
        self.now_s = 0.0

    def tick(
        self,
        goal: Vector = ZERO,
        wrench: Vector | None = None,
        reading: Callable[[HapticReading], HapticReading] | None = lambda reading: reading,
    ) -> Vector:
        """Goes on by a tick and returns the force.

        Args:
            goal: Position to which the hand pulls the handle.
            wrench: What the simulator says, None if it is silent.
            reading: Changes what the device says; None if it is silent.
        """
        self.now_s += DT_S
        if wrench is not None:
            self.controller.observe_wrench(wrench, self.now_s)
        true = HapticReading(self.hand.position, self.hand.velocity)
        force = self.controller.tick(self.now_s, reading and reading(true))
        self.hand.step(goal, force, DT_S)
        return force
