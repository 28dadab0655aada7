"""Controller with springs and dampers at the joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field, WithJsonSchema

from custom_ros_tools.schema import Text
from rpbi.control.jitter_buffer import BUFFER_S, JitterBuffer
from rpbi.control.joint_command import JointCommand
from rpbi.control.target_stream import TargetStream

from .controller import Array, ControlledRobot, Controller, ControllerConfig, RobotState
from .impedance import JointImpedance, JointSprings


class JointImpedanceConfig(JointSprings, ControllerConfig):
    """Configuration of a `joint_impedance` controller."""

    type: Annotated[Text, WithJsonSchema({"enum": ["joint_impedance"]})] = Field(
        description="`joint_impedance`, or a class that accepts the same keys."
    )


class JointImpedanceController(Controller):
    """Pulls joints to target positions by springs and dampers, and compensates gravity and Coriolis forces.

    The input `target` holds positions [rad or m], and optionally efforts [N m or N] to add.
    """

    Config = JointImpedanceConfig
    inputs = {"target": "rpbi.ros.inputs:JOINT_TARGET"}

    def __init__(self, arm: ControlledRobot, config: JointImpedanceConfig) -> None:
        super().__init__(arm, config)
        self._joints = [arm.model.joints[place] for place in arm.chosen]
        self._places = {joint.name: place for place, joint in enumerate(self._joints)}
        self._springs = JointImpedance(config, self._joints, arm.dt_s)

    def check(self, key: str, value: JointCommand | Mapping[str, float]) -> JointCommand:
        """Checks a target for some or all of the controller's joints, and returns the target as a `JointCommand`.

        Args:
            key: Name of the input.
            value: A command with positions, or a mapping from joint names to positions [rad or m].

        Raises:
            ValueError: If a joint is unknown, or a value is missing, not finite or outside the joint's limits.
        """
        value = JointCommand.of(value, "position")
        positions = value.values_of("position", "its targets are positions")
        for name, position in zip(value.names, positions, strict=True):
            joint = self._joint(name)
            if not joint.allows(position):
                raise ValueError(joint.limit_violation(position))
        for name in value.names:
            self._joint(name)
        if not np.isfinite([*positions, *value.effort]).all():
            raise ValueError(f"targets must be finite, got {list(positions)}, efforts {list(value.effort)}")
        if value.effort and len(value.effort) != len(value.names):
            raise ValueError(f"expected one effort for each of the {len(value.names)} joints, got {len(value.effort)}")
        return value

    def start(self, state: RobotState, tick: int) -> None:
        """Sets the target to the measured positions, until the first target comes."""
        held = {place: state.position[chosen] for place, chosen in enumerate(self.arm.chosen)}
        self._stream = TargetStream(JitterBuffer(self.arm.dt_s, BUFFER_S), held, smooth=True)
        self._push = np.zeros(len(held))
        self._springs.restart()
        self._taken: Any = None
        self._goal = dict(held)

    def compute(self, state: RobotState, targets: Mapping[str, Any], tick: int) -> Array:
        """Returns the efforts of the springs and dampers plus the compensation of gravity and Coriolis forces."""
        self._update_target(targets.get("target"), tick)
        before = np.array(list(self._stream.set_points.values()))
        after = np.array(list(self._stream.advance(tick + 1.0).values()))
        chosen, model, dt_s = self.arm.chosen, self.arm.model, self.arm.dt_s
        mass = self.arm.of_chosen(self.arm.of_chosen(model.mass_matrix(state.position)).T)
        self._error = before - np.array(state.position)[chosen]
        velocity = np.array(state.velocity)[chosen]
        efforts = self._springs.efforts(mass, self._error, velocity, (after - before) / dt_s, self._push)
        bias: Array = self.arm.of_chosen(model.bias(state.base, state.position, state.velocity))
        return efforts + bias

    def report(self) -> Mapping[str, float]:
        """Returns the position error [rad or m] of each joint, desired minus measured."""
        return {f"error/{joint.name}": float(error) for joint, error in zip(self._joints, self._error)}

    def _update_target(self, target: JointCommand | None, tick: int) -> None:
        if target is None or target is self._taken:
            return
        self._taken = target
        places = [self._places[name] for name in target.names]
        self._goal = self._goal | dict(zip(places, map(float, target.position)))
        self._stream.push(tick, self._goal, {}, target.stamp_ns)
        if target.effort:
            self._push[places] = target.effort

    def _joint(self, name: str) -> Any:
        if name not in self._places:
            raise ValueError(f"'{name}' is none of its joints: {', '.join(self._places)}")
        return self._joints[self._places[name]]
