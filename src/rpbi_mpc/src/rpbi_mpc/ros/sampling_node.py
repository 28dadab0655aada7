"""`sampling_mpc_node.py`: commands a robot by the best of its predicted futures."""

from __future__ import annotations

import numpy as np
import rospy
from sensor_msgs.msg import JointState

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.parameters import private_config
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.services import get_srv_handler
from ros_pybullet_interface.msg import Candidate
from ros_pybullet_interface.msg import PlannedInput as PlannedInputMessage
from ros_pybullet_interface.srv import Predict, SetJointState, StepN
from rpbi_mpc.node_configs import SamplingNodeConfig
from rpbi_mpc.plant import Plant, Sensed
from rpbi_mpc.sampling import InputConfig, SamplingController
from rpbi_mpc.sampling.world import planned, whole_ticks

from .loop_node import LoopNode
from .plants import time_step_s

NODE = "sampling_mpc"
TARGET = "/target"


class SteppedSimulator(Plant):
    """A simulator that stands still between the steps, and predicts by `rpbi/predict`.

    Args:
        config: The targets of a robot that are commanded.
        cost: Cost of a state.

    Raises:
        InterfaceError: If the simulator refuses to be stepped, or the input is not the target of a robot.
    """

    def __init__(self, config: InputConfig, cost: str) -> None:
        if not config.input.endswith(TARGET):
            expected = "expected the target of a robot, such as NAME/target"
            raise InterfaceError(f"command.input: {expected}, got '{config.input}'")
        self._config, self._cost = config, cost
        self.names = config.names
        self.lower, self.upper = np.array(config.lower), np.array(config.upper)
        robot = config.input.removesuffix(TARGET)
        self._step = get_srv_handler("rpbi/step_n", StepN, persistent=True)
        self._predict = get_srv_handler("rpbi/predict", Predict, persistent=True)
        self._set_target = get_srv_handler(f"rpbi/{robot}/set_target", SetJointState, persistent=True)
        self._dt_s = round(time_step_s(self._step), 9)
        self._time_s = self._step_by(1)

    def sense(self) -> Sensed:
        return Sensed(self._time_s, np.array([self._time_s]))

    def act(self, command: np.ndarray) -> None:
        answer = self._set_target(JointState(name=list(self.names), position=command.tolist()))
        if not answer.success:
            raise InterfaceError(f"{self._config.input}: {answer.message}")

    def stand(self) -> None:
        """Leaves the last target, at which the robot holds."""

    def advance(self, duration_s: float) -> None:
        self._time_s = self._step_by(whole_ticks(duration_s, self._dt_s))

    def costs(self, commands: np.ndarray, period_s: float, delay_s: float) -> np.ndarray:
        """Returns the cost of each candidate, see `Rollouts`."""
        period, delay = whole_ticks(period_s, self._dt_s), whole_ticks(delay_s, self._dt_s)
        answer = self._predict(
            candidates=[self._candidate(each, period, delay) for each in commands],
            ticks=delay + commands.shape[1] * period,
            cost=self._cost,
        )
        if not answer.success:
            raise InterfaceError(f"rpbi/predict: {answer.message}")
        for fault in sorted({each.fault for each in answer.predictions if each.fault}):
            rospy.logwarn_throttle(5.0, f"not simulated: {fault}")
        return np.array([each.cost for each in answer.predictions])

    def _candidate(self, commands: np.ndarray, period: int, delay: int) -> Candidate:
        return Candidate(
            [
                PlannedInputMessage(each.tick, each.slot, [*each.value], [*each.value.values()])
                for each in planned(commands, self._config, period, delay)
            ]
        )

    def _step_by(self, ticks: int) -> float:
        """Advances by ticks, and returns the time [s]."""
        answer = self._step(ticks)
        if not answer.success:
            raise InterfaceError(f"rpbi/step_n: {answer.message}")
        return float(answer.stamp.to_sec())


def _start() -> LoopNode:
    config = private_config(SamplingNodeConfig)
    plant = SteppedSimulator(config.command, config.cost)
    controller = SamplingController(plant, config.sampling, config.loop.hz, np.array(config.command.middle))
    return LoopNode(plant, controller, config.loop)


def main() -> None:
    """Runs the node."""
    run_node(NODE, _start, LoopNode.run, loggers=("rpbi_mpc",))
