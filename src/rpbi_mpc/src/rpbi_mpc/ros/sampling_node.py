"""`sampling_mpc_node.py`: controls a robot with plans that follow from the costs of simulated candidate plans."""

from __future__ import annotations

import numpy as np
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.parameters import private_config
from custom_ros_tools.ros.lifecycle.run_node import run_node
from rpbi_mpc.controller import Plant, Sensed
from rpbi_mpc.node_configs import SamplingNodeConfig
from rpbi_mpc.sampling import InputConfig, SamplingController
from rpbi_mpc.sampling.world import planned, whole_ticks

from .loop_node import LoopNode
from .simulator import SteppedSimulator

NODE = "sampling_mpc"
TARGET = "/target"


class PredictedRobot(Plant):
    """A robot in a stepped simulator. The service `rpbi/predict` simulates candidates.

    Args:
        config: Commanded input, which must be the target of a robot.
        cost: Cost of a state, as `module:name`.

    Raises:
        InterfaceError: If the simulator rejects steps, or the input is not the target of a robot.
    """

    def __init__(self, config: InputConfig, cost: str) -> None:
        if not config.input.endswith(TARGET):
            expected = "expected the target of a robot, such as NAME/target"
            raise InterfaceError(f"command.input: {expected}, got '{config.input}'")
        self._config, self._cost = config, cost
        self.names = config.names
        self.lower, self.upper = np.array(config.lower), np.array(config.upper)
        self._simulator = SteppedSimulator(config.input.removesuffix(TARGET))

    def sense(self) -> Sensed:
        return Sensed(self._simulator.time_s, np.array([self._simulator.time_s]))

    def act(self, command: np.ndarray) -> None:
        self._simulator.set_target(JointState(name=list(self.names), position=command.tolist()))

    def stand(self) -> None:
        """Does nothing: the robot stays at its last target."""

    def advance(self, duration_s: float) -> None:
        self._simulator.step(whole_ticks(duration_s, self._simulator.dt_s))

    def costs(self, commands: np.ndarray, period_s: float, delay_s: float) -> np.ndarray:
        """Simulates candidates, and returns the cost of each candidate; see `Rollouts`."""
        period, delay = (whole_ticks(each_s, self._simulator.dt_s) for each_s in (period_s, delay_s))
        candidates = [planned(each, self._config, period, delay) for each in commands]
        found = self._simulator.predict(candidates, delay + commands.shape[1] * period, cost=self._cost)
        return np.array([each.cost for each in found])


def _start() -> LoopNode:
    config = private_config(SamplingNodeConfig)
    plant = PredictedRobot(config.command, config.cost)
    controller = SamplingController(plant, config.sampling, config.loop.hz, np.array(config.command.middle))
    return LoopNode(plant, controller, config.loop)


def main() -> None:
    """Runs the node."""
    run_node(NODE, _start, LoopNode.run, loggers=("rpbi_mpc",))
