"""A spring and a damper between a link and a target in space."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field, WithJsonSchema

from custom_ros_tools.schema import NonNegative, Text, Unit
from rpbi.control.target_stream import Arrivals, TargetStream
from rpbi.engine.inputs import check_pose
from rpbi.geometry import Pose, rotated

from .controller import Arm, Array, Controller, ControllerConfig, RobotState
from .impedance import (
    DampingRatio,
    ExternalEfforts,
    cartesian_impedance,
    columns_solved,
    damping_of,
    joint_impedance,
    turn_between,
)
from .joint_impedance import BUFFER_S

ROUNDING = 1e-6 * np.eye(6)
"""Keeps the mobility of a singular arm invertible."""


class PoseTarget(NamedTuple):
    """Where a point of a link is to be.

    Attributes:
        pose: In the world.
        stamp_ns: When it was sent, by the sender's clock [ns], 0 if that is not known.
    """

    pose: Pose
    stamp_ns: int = 0


class CartesianImpedanceConfig(ControllerConfig):
    """Keys of `cartesian_impedance`."""

    type: Annotated[Text, WithJsonSchema({"enum": ["cartesian_impedance"]})] = Field(
        description="`cartesian_impedance`, or a class that takes its keys."
    )

    link: Text = Field(description="The link that is held.")
    point: Annotated[tuple[float, float, float], Field(strict=False), Unit("m")] = Field(
        (0.0, 0.0, 0.0), description="The point of it that is held, in its frame."
    )
    stiffness: Annotated[NonNegative, Unit("N/m")] = Field(1000.0, le=5000.0, description="Along each axis.")
    rotational_stiffness: Annotated[NonNegative, Unit("N m/rad")] = Field(
        100.0, le=300.0, description="About each axis."
    )
    damping_ratio: DampingRatio = Field(0.7, description="By the critical damping of the arm's inertia at the point.")
    posture_stiffness: Annotated[NonNegative, Unit("N m/rad or N/m")] = Field(
        20.0, description="With which joints keep to where they were at the start, as far as the point lets them."
    )


class CartesianImpedanceController(Controller):
    """Holds a point of a link at a target pose as a spring and a damper do.

    Gravity and Coriolis forces are compensated. `target` is a pose in the world. A redundant arm keeps to the posture
    that it had at the start.
    """

    Config = CartesianImpedanceConfig
    inputs = {"target": "rpbi.ros.robots.controller_messages:POSE_TARGET"}

    def __init__(self, arm: Arm, config: Any) -> None:
        super().__init__(arm, config)
        if config.link not in arm.links:
            raise ValueError(f"link: there is no link '{config.link}', there are {', '.join(arm.links)}")
        self._link = arm.links[config.link]

    def check(self, key: str, value: PoseTarget) -> PoseTarget:
        """Takes finite poses."""
        return value._replace(pose=check_pose(value.pose))

    def start(self, state: RobotState, tick: int) -> None:
        """Holds the pose and the posture that are measured."""
        self._goal = self._pose()
        self._stream = TargetStream(Arrivals(self.arm.dt_s, BUFFER_S), _components(self._goal), smooth=True)
        self._posture = np.array(state.position)[self.arm.chosen]
        self._external = ExternalEfforts(len(self._posture), self.arm.dt_s)
        self._ones, self._zeros = np.ones_like(self._posture), np.zeros_like(self._posture)
        self._posture_stiffness = self.config.posture_stiffness * self._ones
        self._taken: Any = None

    def compute(self, state: RobotState, targets: Mapping[str, Any], tick: int) -> Array:
        """Returns the efforts of the spring, the damper and what balances gravity and motion."""
        self._take(targets.get("target"), tick)
        wanted = list(self._stream.advance(tick + 1.0).values())
        arm, dt_s = self.arm, self.arm.dt_s
        chosen, q = arm.chosen, state.position
        jacobian = arm.model.jacobian(state.base, q, self._link, self.config.point)[:, chosen]
        mass = arm.model.mass_matrix(q)[np.ix_(chosen, chosen)]
        joint_velocity = np.array(state.velocity)[chosen]
        by_force = columns_solved(mass, jacobian)
        mobility = jacobian @ by_force.T
        velocity = jacobian @ joint_velocity
        pose = self._pose()
        turn = turn_between(pose.quat_xyzw, wanted[3:])
        self._error = np.concatenate((np.subtract(wanted[:3], pose.position), turn))
        self._external.update(joint_velocity)
        external = self._external.estimate
        stiffness, damping, push = self._springs(mobility)
        self._wrench = cartesian_impedance(
            mobility, stiffness, damping, self._error, velocity, push, by_force @ external, dt_s
        )
        efforts: Array = jacobian.T @ self._wrench
        if self.config.posture_stiffness:
            pull = joint_impedance(
                mass, self._posture_stiffness, self._ones, self._posture - np.array(q)[chosen], joint_velocity,
                self._zeros, external, dt_s
            )  # fmt: skip
            efforts += pull - jacobian.T @ np.linalg.solve(mobility + ROUNDING, by_force @ pull)
        self._external.note(mass, efforts, joint_velocity)
        return efforts + arm.model.bias(state.base, q, state.velocity)[chosen]

    def report(self) -> Mapping[str, float]:
        """Returns how far it is from the target, and with what force and moment it pulls, in the world's axes."""
        axes = ("x", "y", "z")
        told = {f"error/{axis}": value for axis, value in zip(axes, self._error)}
        told |= {f"turn/{axis}": value for axis, value in zip(axes, self._error[3:])}
        told |= {f"force/{axis}": value for axis, value in zip(axes, self._wrench)}
        told |= {f"moment/{axis}": value for axis, value in zip(axes, self._wrench[3:])}
        return {key: float(value) for key, value in told.items()}

    def _springs(self, mobility: Array) -> tuple[Array, Array, Array]:
        """Returns stiffness and damping, shape (6, 6), and a push [N, N m], shape (6,), in the world's axes."""
        config = self.config
        stiffness = np.repeat((config.stiffness, config.rotational_stiffness), 3)
        damping = damping_of(mobility, np.eye(3), stiffness, config.damping_ratio)
        return np.diag(stiffness), np.diag(damping), np.zeros(6)

    def _pose(self) -> Pose:
        pose = self.arm.link_pose(self._link)
        point = rotated(pose.quat_xyzw, self.config.point)
        return Pose(
            (pose.position[0] + point[0], pose.position[1] + point[1], pose.position[2] + point[2]), pose.quat_xyzw
        )

    def _take(self, target: PoseTarget | None, tick: int) -> None:
        if target is None or target is self._taken:
            return
        self._taken = target
        position, quat = target.pose
        if sum(a * b for a, b in zip(quat, self._goal.quat_xyzw)) < 0.0:  # the same orientation, and near in numbers
            quat = (-quat[0], -quat[1], -quat[2], -quat[3])
        self._goal = Pose(position, quat)
        self._stream.take(tick, _components(self._goal), {}, target.stamp_ns)


def _components(pose: Pose) -> dict[int, float]:
    return dict(enumerate((*pose.position, *pose.quat_xyzw)))
