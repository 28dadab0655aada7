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
    critical_damping,
    force_for,
    inverse,
    joint_impedance,
    turn_between,
)
from .joint_impedance import BUFFER_S

_EYE = np.eye(6)


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
        self._stiffness = np.repeat((config.stiffness, config.rotational_stiffness), 3)
        self._push = np.zeros(6)
        self._axes: Array | None = None
        """Axes of the springs, as columns, shape (6, 6); None for those of the world."""

    def check(self, key: str, value: PoseTarget) -> PoseTarget:
        """Takes finite poses."""
        return value._replace(pose=check_pose(value.pose))

    def start(self, state: RobotState, tick: int) -> None:
        """Holds the pose and the posture that are measured."""
        self._goal = self._pose()
        self._stream = TargetStream(Arrivals(self.arm.dt_s, BUFFER_S), _components(self._goal), smooth=True)
        self._posture = np.array(state.position)[self.arm.chosen]
        self._external = ExternalEfforts(len(self._posture), self.arm.dt_s)
        self._posture_stiffness = np.full(len(self._posture), self.config.posture_stiffness)
        self._taken: Any = None

    def compute(self, state: RobotState, targets: Mapping[str, Any], tick: int) -> Array:
        """Returns the efforts of the spring, the damper and what balances gravity and motion."""
        self._take(targets.get("target"), tick)
        wanted = list(self._stream.advance(tick + 1.0).values())
        arm, config, axes = self.arm, self.config, self._axes
        q, velocity = np.array((state.position, state.velocity))[:, arm.chosen]
        pose = self._pose()
        jacobian = arm.of_chosen(arm.model.jacobian(state.base, state.position, self._link, config.point))
        error = np.concatenate((np.subtract(wanted[:3], pose.position), turn_between(pose.quat_xyzw, wanted[3:])))
        if axes is not None:
            jacobian, error = axes.T @ jacobian, axes.T @ error
        mass = arm.of_chosen(arm.of_chosen(arm.model.mass_matrix(state.position)).T)
        by_force = jacobian @ inverse(mass)
        mobility = by_force @ jacobian.T
        self._external.update(velocity)
        external = self._external.estimate
        damping, of_point, by_others = self._damping(mobility), jacobian @ velocity, by_force @ external
        self._error = error
        self._wrench = cartesian_impedance(
            mobility, self._stiffness, damping, error, of_point, self._push, by_others, arm.dt_s
        )
        efforts: Array = jacobian.T @ self._wrench
        if config.posture_stiffness:
            away = self._posture - q
            pull = joint_impedance(mass, self._posture_stiffness, 1.0, away, velocity, 0.0, external, arm.dt_s)
            efforts += pull - jacobian.T @ force_for(mobility, by_force @ pull)  # Khatib, 1987
        self._external.note(mass, efforts, velocity)
        return efforts + arm.of_chosen(arm.model.bias(state.base, state.position, state.velocity))

    def report(self) -> Mapping[str, float]:
        """Returns how far it is from the target, and with what force and moment it pulls, in the world's axes."""
        axes = _EYE if self._axes is None else self._axes
        numbers = np.concatenate((axes @ self._error, axes @ self._wrench)).tolist()
        names = (f"{what}/{axis}" for what in ("error", "turn", "force", "moment") for axis in "xyz")
        return dict(zip(names, numbers))

    def _damping(self, mobility: Array) -> Array:
        """Returns the damping along each axis of the springs, shape (6,) [N s/m, N m s/rad]."""
        damping: Array = self.config.damping_ratio * critical_damping(mobility, self._stiffness)
        return damping

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
