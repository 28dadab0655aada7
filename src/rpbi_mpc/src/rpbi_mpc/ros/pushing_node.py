"""`pushing_mpc_node.py`: pushes a slider along a path; start, stop and step by services."""

from __future__ import annotations

from pathlib import Path

from custom_ros_tools.ros.lifecycle.parameters import private_config
from custom_ros_tools.ros.lifecycle.run_node import run_node
from rpbi_mpc.hand import PlanarHand
from rpbi_mpc.loop import Cycle
from rpbi_mpc.node_configs import PushingNodeConfig
from rpbi_mpc.pushing.controller import PushingController
from rpbi_mpc.pushing.report import write_report
from rpbi_mpc.pushing.sampling_planner import SamplingPlanner

from .display import PushingDisplay
from .loop_node import LoopNode
from .plants import HandPlant, SteppedPlant, TimedPlant

NODE = "pushing_mpc"


class PushingNode(LoopNode):
    """Pushes a slider with the hand of a robot.

    Raises:
        ConfigError: If the configuration is wrong.
        MissingDependency: If CasADi is not installed.
    """

    def __init__(self) -> None:
        config = private_config(PushingNodeConfig)
        hand, planner = PlanarHand(config.hand), None
        if config.plant.timed:
            self._hand: HandPlant = TimedPlant(config.plant, hand)
        else:
            self._hand = stepped = SteppedPlant(config.plant, hand)
            if config.controller == "sampling":
                planner = SamplingPlanner(stepped, config.pushing, config.sampling)
        self._pushing = PushingController(config.pushing, planner)
        self._display = PushingDisplay(self._pushing.path, config.pushing.slider)
        super().__init__(self._hand, self._pushing, config.loop)

    def show(self, cycle: Cycle) -> None:
        self._display.show(cycle.plan, cycle.sensed)

    def on_stop(self) -> None:
        self._hand.begin_at_the_robot()

    def write_report(self, folder: Path) -> str:
        write_report(folder, self._loop.cycles, self._pushing)
        return self._pushing.failure or self._pushing.result


def main() -> None:
    """Runs the node."""
    run_node(NODE, PushingNode, PushingNode.run, loggers=("rpbi_mpc",))
