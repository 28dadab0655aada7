"""Mobile bases that drive in a plane: velocities, limits and motors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import pybullet
from pydantic import Field

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.schema import ConfigModel, Positive, Seconds, Unit
from robot_model.urdf.document import UrdfDocument
from robot_model.urdf.elements import Element, UrdfJoint
from robot_model.urdf.for_pybullet import Files, for_pybullet, mounted_on
from rpbi.engine.client import Client
from rpbi.geometry import Pose, Twist
from rpbi.plain_values import as_tuple

PLANAR_JOINTS = (0, 1, 2)
"""PyBullet's indices of the joints along x, along y and about z, and also of these joints' child links."""
ROUNDING = 1e-6
"""Largest velocity component [m/s, rad/s] out of the plane that is accepted as zero."""


class PlanarVelocity(NamedTuple):
    """Velocity of a base in its plane.

    Attributes:
        x: Velocity forwards [m/s], in the base frame unless noted otherwise.
        y: Velocity to the left [m/s].
        yaw: Angular velocity, counter-clockwise [rad/s].
    """

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    @classmethod
    def checked(cls, twist: Twist | Mapping[str, Any]) -> PlanarVelocity:
        """Converts a twist, or a mapping of the fields of `Twist`, to a planar velocity.

        Raises:
            ValueError: If a component is not finite, or points out of the plane. The message names the component.
        """
        given = {
            f"{part}.{axis}": value
            for part, vector in as_tuple(Twist, twist)._asdict().items()
            for axis, value in zip("xyz", vector, strict=True)
        }
        bad = [f"{key}={value}" for key, value in given.items() if not math.isfinite(value)]
        if bad:
            raise ValueError(f"velocities must be finite, got {', '.join(bad)}")
        bad = [f"{key}={given[key]:g}" for key in ("linear.z", "angular.x", "angular.y") if abs(given[key]) > ROUNDING]
        if bad:
            raise ValueError(f"a planar base has linear.x, linear.y and angular.z alone, got {', '.join(bad)}")
        return cls(given["linear.x"], given["linear.y"], given["angular.z"])

    def turned(self, yaw: float) -> PlanarVelocity:
        """Returns the velocity rotated about z by a yaw angle [rad], for example from the base frame to the plane."""
        cos, sin = math.cos(yaw), math.sin(yaw)
        return PlanarVelocity(cos * self.x - sin * self.y, sin * self.x + cos * self.y, self.yaw)

    def limited(self, linear: float, angular: float) -> PlanarVelocity:
        """Returns the velocity scaled down to limits; the direction of the translation does not change.

        Args:
            linear: Maximum speed in the plane [m/s].
            angular: Maximum yaw rate [rad/s].
        """
        speed = math.hypot(self.x, self.y)
        share = min(1.0, linear / speed) if speed else 1.0
        return PlanarVelocity(self.x * share, self.y * share, min(max(self.yaw, -angular), angular))

    def towards(self, goal: PlanarVelocity, linear: float, angular: float) -> PlanarVelocity:
        """Returns the velocity moved towards a goal velocity by at most `linear` [m/s] and `angular` [rad/s]."""
        change = PlanarVelocity(goal.x - self.x, goal.y - self.y, goal.yaw - self.yaw).limited(linear, angular)
        return PlanarVelocity(self.x + change.x, self.y + change.y, self.yaw + change.yaw)


class PlanarBaseConfig(ConfigModel):
    """Velocity, acceleration and force limits of a base that drives over the ground."""

    max_linear_velocity: Annotated[Positive, Unit("m/s")] = Field(
        1.0, description="Largest speed in the plane, in any direction."
    )
    max_angular_velocity: Annotated[Positive, Unit("rad/s")] = Field(1.5, description="Largest yaw rate.")
    max_linear_acceleration: Annotated[Positive, Unit("m/s^2")] = Field(
        1.0, description="Largest acceleration in the plane, also when braking."
    )
    max_angular_acceleration: Annotated[Positive, Unit("rad/s^2")] = Field(
        3.0, description="Largest angular acceleration about the vertical, also when braking."
    )
    max_force: Annotated[Positive, Unit("N")] | None = Field(
        None, description="Largest driving force along each axis of the plane. By default, the weight of the robot."
    )
    max_torque: Annotated[Positive, Unit("N m")] | None = Field(
        None,
        description="Largest driving torque about the vertical. By default, the robot's weight times its radius of "
        "gyration.",
    )
    cmd_vel_timeout_s: Seconds = Field(
        0.5, description="Age at which a velocity command expires and the base brakes, in simulated time."
    )


GRAVITY = 9.81
"""Gravity [m/s^2] from which default force limits are computed, independent of the world's gravity."""
POSITION_GAIN = 0.1
"""Share of the position error between set point and base that the motors correct in a tick."""
CATCH_UP_SPEED = (0.5, 0.5, 1.0)
"""Largest additional speed [m/s, m/s, rad/s] along x, y and about z to correct position errors.

A larger error means that an obstacle blocks the base. The set point is then moved towards the base.
"""


def with_planar_joints(document: UrdfDocument, files: Files) -> Element:
    """Inserts joints along x, along y and about z, with massless links, above the root link of a URDF.

    Returns:
        The `robot` element for PyBullet. The new root link is the fixed end of the inserted joints.

    Raises:
        ConfigError: If the URDF is not a tree of links.
    """
    robot = for_pybullet(document, files)
    world, x, y, yaw = (f"planar_base/{name}" for name in ("world", "x", "y", "yaw"))
    chain = (
        UrdfJoint(x, "prismatic", world, x, axis=(1.0, 0.0, 0.0)),
        UrdfJoint(y, "prismatic", x, y, axis=(0.0, 1.0, 0.0)),
        UrdfJoint(yaw, "continuous", y, document.root_link(), axis=(0.0, 0.0, 1.0)),
    )
    mounted_on(robot, document.root_link(), chain)
    return robot


class PlanarBase:
    """Drives the planar joints of a robot at commanded velocities, with limited force.

    The motors track a set point that moves at the commanded velocity within the limits, so that the base does not
    drift. If an obstacle blocks or pushes the base, the set point stays near the base, as if wheels slipped.

    Args:
        body_id: PyBullet's id of a robot that was loaded with planar joints.
        config: Limits of velocity, acceleration and force.
        dt_s: Length of a tick [s].
    """

    def __init__(self, pb: Client, body_id: int, config: PlanarBaseConfig, dt_s: float) -> None:
        self._pb, self._body_id, self._config, self._dt_s = pb, body_id, config, dt_s
        self._timeout_ticks = max(1, round(config.cmd_vel_timeout_s / dt_s))
        self._expiry: int | None = None
        """Tick at which the command expires; None if a command came since the last tick."""
        self._command = PlanarVelocity()
        self._forces = self._force_limits()
        self._max_lags = tuple(speed * dt_s / POSITION_GAIN for speed in CATCH_UP_SPEED)
        self.rest()

    def follow(self, velocity: PlanarVelocity) -> None:
        """Commands a velocity in the base frame, clipped to the limits, until the next command or the time-out."""
        self._command = velocity.limited(self._config.max_linear_velocity, self._config.max_angular_velocity)
        self._expiry = None

    def rest(self) -> None:
        """Sets the set point to the measured joint positions with zero velocity. The commanded velocity is kept."""
        self._velocity = PlanarVelocity()
        self._set_point = [state[0] for state in self._joint_states()]

    def before_step(self, tick: int) -> None:
        """Advances the set point by a tick, and commands the motors."""
        if self._expiry is None:
            self._expiry = tick + self._timeout_ticks
        elif tick >= self._expiry:
            self._command = PlanarVelocity()
        step = self._config.max_linear_acceleration * self._dt_s, self._config.max_angular_acceleration * self._dt_s
        self._velocity = self._velocity.towards(self._command, *step)
        yaw = self._set_point[2] + self._velocity.yaw * self._dt_s / 2.0  # at mid-tick
        velocity = list(self._velocity.turned(yaw))
        is_held_up = False
        for axis, ((position, speed, *_), max_lag) in enumerate(zip(self._joint_states(), self._max_lags)):
            lag = self._set_point[axis] - position
            if abs(lag) > max_lag:
                self._set_point[axis] = position + math.copysign(max_lag, lag)
                velocity[axis], is_held_up = speed, True
        if is_held_up:  # continue from the measured velocity
            self._velocity = PlanarVelocity(*velocity).turned(-yaw)
        self._pb.setJointMotorControlArray(
            self._body_id,
            PLANAR_JOINTS,
            pybullet.POSITION_CONTROL,
            targetPositions=self._set_point,
            targetVelocities=velocity,
            positionGains=(POSITION_GAIN,) * 3,
            velocityGains=(1.0,) * 3,
            forces=self._forces,
        )
        self._set_point = [place + speed * self._dt_s for place, speed in zip(self._set_point, velocity)]

    def pose_in_plane(self) -> Pose:
        """Returns the pose of the root link's frame in the frame of the plane."""
        x, y, yaw = (state[0] for state in self._joint_states())
        return Pose((x, y, 0.0), (0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)))

    def velocity_in_plane(self) -> PlanarVelocity:
        """Returns the velocity of the root link's frame, in the frame of the plane."""
        return PlanarVelocity(*(state[1] for state in self._joint_states()))

    def _joint_states(self) -> tuple[tuple[float, ...], ...]:
        states: tuple[tuple[float, ...], ...] = self._pb.getJointStates(self._body_id, PLANAR_JOINTS)
        return states

    def _force_limits(self) -> tuple[float, float, float]:
        """Returns the motors' force limits along x and y [N] and torque limit about z [N m].

        The defaults correspond to wheels with a friction coefficient of 1. The default force is the robot's weight, and
        the default torque is the weight times the radius of gyration.
        """
        joints = range(self._pb.getNumJoints(self._body_id))
        infos = [self._pb.getJointInfo(self._body_id, index) for index in joints]
        moving = [info[0] for info in infos if info[3] >= 0]
        positions = [state[0] for state in self._pb.getJointStates(self._body_id, moving)]
        inertia = self._pb.calculateMassMatrix(self._body_id, positions)
        mass_kg, yaw_inertia = inertia[0][0], inertia[2][2]
        force = self._config.max_force or mass_kg * GRAVITY
        torque = self._config.max_torque or GRAVITY * math.sqrt(mass_kg * yaw_inertia)
        if not force or not torque:
            raise ConfigError([Problem("", "planar_base", "the robot has no mass; give max_force and max_torque")])
        return force, force, torque
