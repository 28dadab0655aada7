"""The motion and sleep of bodies, which are read from one PyBullet client and set in another."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import chain
from typing import Any, NamedTuple

import pybullet

from robot_model.geometry import Quaternion, Vector
from rpbi.bodies import Body
from rpbi.engine.client import MAXIMAL_COORDINATES, Client

_UNUSUAL_GRAVITY = (1.0, 2.0, 30.0)
"""Gravity [m/s^2] that visibly moves every body that does not sleep."""


class BodyMotion(NamedTuple):
    """Pose, joint positions and velocities of a body, in the world frame.

    Attributes:
        position: Position of the base's centre of mass [m].
        quat_xyzw: Orientation of the base's principal axes of inertia.
        linear: Linear velocity of the base [m/s].
        angular: Angular velocity of the base [rad/s].
        joints: PyBullet's indices of all joints that are not fixed.
        positions: Position [rad or m] of each joint in `joints`; for a spherical joint, a quaternion.
        velocities: Velocity [rad/s or m/s] of each joint in `joints`.
    """

    position: Vector
    quat_xyzw: Quaternion
    linear: Vector
    angular: Vector
    joints: tuple[int, ...]
    positions: tuple[tuple[float, ...], ...]
    velocities: tuple[tuple[float, ...], ...]

    @classmethod
    def of(cls, body: Body) -> BodyMotion:
        """Reads the present motion of a body from PyBullet."""
        pb, body_id = body.pb, body.body_id
        joints = tuple(i for i in body.joint_indices if pb.getJointInfo(body_id, i)[2] != pybullet.JOINT_FIXED)
        states = pb.getJointStatesMultiDof(body_id, joints) if joints else ()
        position, quat_xyzw = pb.getBasePositionAndOrientation(body_id)
        linear, angular = pb.getBaseVelocity(body_id)
        positions, velocities = (tuple(state[kind] for state in states) for kind in (0, 1))
        return cls(position, quat_xyzw, linear, angular, joints, positions, velocities)

    def check(self, body: Body) -> None:
        """Checks that the motion fits a body, since PyBullet may crash if it does not.

        Raises:
            ValueError: If the joints differ from the body's joints, or a number is not finite.
        """
        own = BodyMotion.of(body)
        numbers = [*chain(*self[:4], *self.positions, *self.velocities)]
        if [_shape(each) for each in self] != [_shape(each) for each in own] or self.joints != own.joints:
            raise ValueError(f"'{body.name}': expected a motion of {len(own.joints)} joints, got {str(self):.200}")
        if not all(type(number) is float and math.isfinite(number) for number in numbers):
            raise ValueError(f"'{body.name}': expected a motion of finite numbers, got {str(self):.200}")

    def put(self, body: Body) -> None:
        """Sets the pose, joint positions and velocities of a body."""
        pb, body_id = body.pb, body.body_id
        pb.resetBasePositionAndOrientation(body_id, self.position, self.quat_xyzw)
        pb.resetBaseVelocity(body_id, self.linear, self.angular)
        if self.joints:
            positions, velocities = (list(map(list, each)) for each in (self.positions, self.velocities))
            pb.resetJointStatesMultiDof(body_id, list(self.joints), positions, velocities)  # tuples crash PyBullet


def _shape(values: Any) -> Any:
    return [_shape(each) for each in values] if isinstance(values, tuple) else None


def asleep(pb: Client, bodies: Mapping[str, Body]) -> tuple[str, ...]:
    """Returns the names of the bodies that PyBullet has put to sleep.

    Changes gravity and makes a simulation step: only sleeping bodies then stay where they are. The client must not be
    used afterwards, since the step changes the client's state.
    """
    movable = {name: body for name, body in bodies.items() if _can_move(body)}
    before = {name: body.motion_state() for name, body in movable.items()}
    pb.setGravity(*_UNUSUAL_GRAVITY)
    pb.stepSimulation()
    return tuple(name for name, body in movable.items() if body.motion_state() == before[name])


def put_to_sleep(bodies: Mapping[str, Body], names: tuple[str, ...]) -> None:
    """Puts the named bodies to sleep, and wakes all other bodies that were loaded asleep."""
    for name, body in bodies.items():
        if name in names:
            body.pb.changeDynamics(body.body_id, -1, activationState=pybullet.ACTIVATION_STATE_SLEEP)
        elif _starts_asleep(body):
            body.pb.changeDynamics(body.body_id, -1, activationState=pybullet.ACTIVATION_STATE_WAKE_UP)


def _can_move(body: Body) -> bool:
    info = body.pb.getDynamicsInfo(body.body_id, -1)
    return body.has_physics and (info[0] > 0.0 or (info[10] != MAXIMAL_COORDINATES and bool(body.joint_indices)))


def _starts_asleep(body: Body) -> bool:
    change = getattr(getattr(body, "config", None), "changeDynamics", None)
    state = getattr(change, "activationState", None) or 0
    return bool(state & pybullet.ACTIVATION_STATE_SLEEP)
