"""A client for the services of a simulator that advances only in requested steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rospy
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.services import get_srv_handler
from ros_pybullet_interface.msg import Candidate, Prediction
from ros_pybullet_interface.msg import PlannedInput as PlannedInputMessage
from ros_pybullet_interface.srv import Predict, SetJointState, StepN
from rpbi.world.forks.prediction import PlannedInput


class SteppedSimulator:
    """Calls services of the simulator: steps the simulator, sets a robot's targets, and requests predictions.

    The constructor pauses a running simulation, and then advances the simulation by two ticks.

    Args:
        robot: Name of the robot whose targets are set.

    Attributes:
        dt_s: Duration of a tick [s].
        time_s: Simulation time of the last tick [s].

    Raises:
        InterfaceError: If the simulator rejects a step.
    """

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._step_n = get_srv_handler("rpbi/step_n", StepN, persistent=True)
        self._predict = get_srv_handler("rpbi/predict", Predict, persistent=True)
        self._set_target = get_srv_handler(f"rpbi/{robot}/set_target", SetJointState, persistent=True)
        get_srv_handler("rpbi/stop", Trigger)()  # it may be stopped already
        self.step(1)
        before_s = self.time_s
        self.step(1)
        self.dt_s = round(self.time_s - before_s, 9)

    def step(self, ticks: int) -> None:
        """Advances the simulator by a number of ticks.

        Raises:
            InterfaceError: If the simulator rejects the request.
        """
        answer = _accepted("rpbi/step_n", self._step_n(ticks))
        self.time_s = float(answer.stamp.to_sec())

    def set_target(self, target: JointState) -> None:
        """Sets joint targets, which act from the next tick on.

        Raises:
            InterfaceError: If the simulator rejects the request.
        """
        _accepted(f"rpbi/{self._robot}/set_target", self._set_target(target))

    def predict(
        self,
        candidates: Sequence[Sequence[PlannedInput]],
        ticks: int,
        watch: Sequence[str] = (),
        every: int = 0,
        cost: str = "",
    ) -> list[Prediction]:
        """Simulates candidates from the present state, and returns the prediction for each; see `World.predict`.

        Args:
            candidates: Planned inputs of each candidate.
            ticks: Number of ticks to simulate.
            watch: Names of the bodies whose states are returned.
            every: Number of ticks between two returned states; 0 means 10.
            cost: Cost of a state, as `module:name`. Empty: without a cost.

        Raises:
            InterfaceError: If the simulator rejects the request.
        """
        messages = [Candidate([_message(each) for each in candidate]) for candidate in candidates]
        answer = self._predict(candidates=messages, ticks=ticks, watch=watch, every=every, cost=cost)
        _accepted("rpbi/predict", answer)
        for fault in sorted({each.fault for each in answer.predictions if each.fault}):
            rospy.logwarn_throttle(5.0, f"not simulated: {fault}")
        found: list[Prediction] = answer.predictions
        return found


def _accepted(service: str, answer: Any) -> Any:
    """Checks that a service has accepted a request, and returns the service's answer.

    Raises:
        InterfaceError: If the service has rejected the request.
    """
    if not answer.success:
        raise InterfaceError(f"{service}: {answer.message}")
    return answer


def _message(planned: PlannedInput) -> PlannedInputMessage:
    return PlannedInputMessage(planned.tick, planned.slot, [*planned.value], [*planned.value.values()])
