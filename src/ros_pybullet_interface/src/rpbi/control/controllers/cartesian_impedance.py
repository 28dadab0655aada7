"""Controller with a spring and a damper between a link and a target pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field, WithJsonSchema

from custom_ros_tools.schema import NonNegative, Text, Unit
from robot_model.geometry import minus, plus
from robot_model.linear_algebra import inverse
from rpbi.control.jitter_buffer import BUFFER_S, JitterBuffer
from rpbi.control.target_stream import TargetStream
from rpbi.engine.inputs import check_pose
from rpbi.geometry import Pose, rotated

from .controller import Array, ControlledRobot, Controller, ControllerConfig, RobotState
from .impedance import DampingRatio, Disturbance, force_for, implicit, implicit_wrench, turn_between

LEAST_MOBILITY = 0.01
"""Lower bound of the mobility when damping is computed [1/kg, 1/(kg m^2)]: keeps damping finite at singularities."""


class PoseTarget(NamedTuple):
    """Target pose of a point of a link.

    Attributes:
        pose: Position of the point and orientation of the link, in the world frame.
        stamp_ns: Time [ns] of sending by the sender's clock; 0 if unknown.
    """

    pose: Pose
    stamp_ns: int = 0


class CartesianImpedanceConfig(ControllerConfig):
    """Configuration of a `cartesian_impedance` controller."""

    type: Annotated[Text, WithJsonSchema({"enum": ["cartesian_impedance"]})] = Field(
        description="`cartesian_impedance`, or a class that accepts the same keys."
    )

    link: Text = Field(description="Link that is pulled to the target pose.")
    point: Annotated[tuple[float, float, float], Field(strict=False), Unit("m")] = Field(
        (0.0, 0.0, 0.0), description="Controlled point of the link, in the link's frame."
    )
    stiffness: Annotated[NonNegative, Unit("N/m")] = Field(
        1000.0, le=5000.0, description="Translational stiffness along each axis."
    )
    rotational_stiffness: Annotated[NonNegative, Unit("N m/rad")] = Field(
        100.0, le=300.0, description="Rotational stiffness about each axis."
    )
    damping_ratio: DampingRatio = Field(
        0.7, description="Damping, as a fraction of the critical damping for the arm's inertia at the point."
    )
    posture_stiffness: Annotated[NonNegative, Unit("N m/rad or N/m")] = Field(
        20.0,
        description="Stiffness with which joints are pulled to the posture at the start of the controller, as far as "
        "the target pose permits.",
    )


class CartesianImpedanceController(Controller):
    """Pulls a point of a link to a target pose by a spring and a damper, and compensates gravity and Coriolis forces.

    The input `target` is a pose in the world frame. A redundant arm is pulled to the posture that was measured when the
    controller started, as far as the target pose permits.
    """

    Config = CartesianImpedanceConfig
    inputs = {"target": "rpbi.ros.inputs:POSE_TARGET"}

    def __init__(self, arm: ControlledRobot, config: Any) -> None:
        super().__init__(arm, config)
        if config.link not in arm.links:
            raise ValueError(f"link: there is no link '{config.link}', there are {', '.join(arm.links)}")
        self._link = arm.links[config.link]
        self._stiffness = np.repeat((config.stiffness, config.rotational_stiffness), 3)
        self._critical = 2.0 * config.damping_ratio * np.sqrt(self._stiffness)
        self._push = np.zeros(6)
        self._axes: Array | None = None
        """Axes of the springs as columns, shape (6, 6); None for the world's axes."""
        self._posture_stiffness = np.full(len(arm.chosen), config.posture_stiffness)

    def check(self, key: str, value: PoseTarget | Pose | Mapping[str, Any]) -> PoseTarget:
        """Checks that a pose is finite, and returns the pose as a `PoseTarget`."""
        if not isinstance(value, PoseTarget):
            return PoseTarget(check_pose(value))
        return value._replace(pose=check_pose(value.pose))

    def start(self, state: RobotState, tick: int) -> None:
        """Sets the target pose to the measured pose, and the posture to the measured joint positions."""
        self._goal = self._pose()
        self._stream = TargetStream(JitterBuffer(self.arm.dt_s, BUFFER_S), _components(self._goal), smooth=True)
        self._posture = np.array(state.position)[self.arm.chosen]
        self._disturbance = Disturbance(len(self._posture), self.arm.dt_s)
        self._taken: Any = None

    def compute(self, state: RobotState, targets: Mapping[str, Any], tick: int) -> Array:
        """Returns the efforts of the spring and the damper plus the compensation of gravity and Coriolis forces."""
        self._update_target(targets.get("target"), tick)
        arm, config = self.arm, self.config
        q, velocity = arm.of_chosen(np.array((state.position, state.velocity)))
        error = self._error = np.array(self._way(tick))
        jacobian = arm.of_chosen(arm.model.jacobian(state.base, state.position, self._link, config.point))
        if self._axes is not None:
            jacobian, error = self._axes.T @ jacobian, self._axes.T @ error
        mass = arm.of_chosen(arm.of_chosen(arm.model.mass_matrix(state.position)).T)
        by_effort = inverse(mass)
        mobility = jacobian @ by_effort @ jacobian.T
        self._disturbance.update(velocity)
        unforced = self._disturbance.estimate
        self._wrench = implicit_wrench(
            mobility,
            self._stiffness,
            self._damping(mobility),
            self._stiffness * error + self._push,
            jacobian @ (velocity / arm.dt_s + unforced),
            arm.dt_s,
        )
        wrench = self._wrench
        if config.posture_stiffness:
            damping = 2.0 * np.sqrt(self._posture_stiffness * mass.diagonal())
            pull = self._posture_stiffness * (self._posture - q)
            turns = implicit(mass, self._posture_stiffness, damping, pull, velocity, arm.dt_s)
            wrench = wrench - force_for(mobility, jacobian @ turns)  # Khatib, 1987
            efforts = jacobian.T @ wrench + mass @ turns
        else:
            efforts = jacobian.T @ wrench
        self._disturbance.predict(velocity, by_effort @ efforts + unforced)
        bias: Array = arm.of_chosen(arm.model.bias(state.base, state.position, state.velocity))
        return efforts + bias

    def report(self) -> Mapping[str, float]:
        """Returns the pose error [m, rad] and the controller's wrench [N, N m], both in the world's axes."""
        wrench = self._wrench if self._axes is None else self._axes @ self._wrench
        numbers = (*self._error.tolist(), *wrench.tolist())
        names = (f"{what}/{axis}" for what in ("error", "turn", "force", "moment") for axis in "xyz")
        return dict(zip(names, numbers))

    def _damping(self, mobility: Array) -> Array:
        """Returns the damping [N s/m, N m s/rad] along and about each axis of the springs, shape (6,)."""
        damping: Array = self._critical / np.sqrt(np.maximum(mobility.diagonal(), LEAST_MOBILITY))
        return damping

    def _way(self, tick: int) -> Sequence[float]:
        """Advances the target stream by one tick, and returns the pose error: 6 numbers.

        The error is the translation [m] and the rotation vector [rad] from the measured pose to the stream's pose.
        """
        x, y, z, *quat = self._stream.advance(tick + 1.0).values()
        pose = self._pose()
        return *minus((x, y, z), pose.position), *turn_between(pose.quat_xyzw, quat)

    def _pose(self) -> Pose:
        position, quat = self.arm.link_pose(self._link)
        return Pose(plus(position, rotated(quat, self.config.point)), quat)

    def _update_target(self, target: PoseTarget | None, tick: int) -> None:
        if target is None or target is self._taken:
            return
        self._taken = target
        position, quat = target.pose
        if sum(a * b for a, b in zip(quat, self._goal.quat_xyzw)) < 0.0:  # -quat is the same orientation, but nearer
            quat = (-quat[0], -quat[1], -quat[2], -quat[3])
        self._goal = Pose(position, quat)
        self._stream.push(tick, _components(self._goal), {}, target.stamp_ns)


def _components(pose: Pose) -> dict[int, float]:
    return dict(enumerate((*pose.position, *pose.quat_xyzw)))
