"""Base class of all bodies in the world."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar

import pybullet

from custom_ros_tools.errors import PhysicsError
from custom_ros_tools.schema import ConfigModel
from robot_model.geometry import cross, minus, plus
from rpbi.config.pybullet_models import ObjectTf, ResetBaseVelocity
from rpbi.control.external_wrenches import ExternalWrench, ExternalWrenches
from rpbi.control.pose_follower import PoseFollower, TrackedBase
from rpbi.engine.client import MAXIMAL_COORDINATES, Client
from rpbi.engine.inputs import Input, PoseInput
from rpbi.geometry import Pose, Twist
from rpbi.samples import BodyState
from rpbi.sensors.sensor import Sensor

log = logging.getLogger(__name__)

MULTI_BODY = 2
"""Type in `getDynamicsInfo` of bodies in reduced coordinates."""
UNNAMED_LINK = "link0"
"""PyBullet's name of the only link of a shape; missing in maximal coordinates."""


class Body:
    """A body in one PyBullet client.

    To add a type of body, write a subclass with a `Config` and an `__init__` that creates the body in PyBullet and
    passes PyBullet's id of the body to `Body.__init__`. All other methods have defaults. If `__init__` raises, the
    caller removes everything that PyBullet has created.
    """

    Config: ClassVar[type[ConfigModel]]
    is_soft: ClassVar[bool] = False
    """Whether the body has neither links nor a fixed shape."""
    has_physics: ClassVar[bool] = True
    """Whether the body has contacts; otherwise it is only visible."""
    section: ClassVar[str] = "objects"
    """Key of the list in the main YAML file for objects of this type; the default is the list for types from other
    packages."""
    example: ClassVar[Mapping[str, Any]] = {}
    """YAML keys, without the name, of an example body that has all ROS interfaces of this type.

    If the type can follow a TF frame, the example follows `FRAME`. The reference pages are generated from the example.
    """
    not_in_keyframes: ClassVar[tuple[str, ...]] = ("_inertial", "_base")
    """Attributes that keyframes leave out, since they are caches that reading the body's pose fills."""
    object_tf: ObjectTf | None = None
    """The TF frame that the base follows; None if it does not follow a frame."""

    @classmethod
    def prepare(cls, config: Any, has_window: bool) -> None:
        """Prepares and caches data that are slow to compute, without calling PyBullet; any thread may call this method.

        Raises:
            ConfigError: If data cannot be prepared from the configuration.
        """

    def __init__(self, pb: Client, name: str, body_id: int) -> None:
        if body_id < 0:
            raise PhysicsError(f"{name}: PyBullet did not create the body")
        self.pb = pb
        self.name = name
        self.body_id = body_id
        self.joint_indices = tuple(range(pb.getNumJoints(body_id)))
        self.link_indices = self.joint_indices
        """PyBullet's indices of all links except the root."""
        self.root_link: str = pb.getBodyInfo(body_id)[0].decode() or UNNAMED_LINK
        self._link_names = {index: pb.getJointInfo(body_id, index)[12].decode() for index in self.joint_indices}
        self._link_names[-1] = self.root_link
        self._given_dynamics: dict[str, Any] = {}
        inertial = self.dynamics_info(-1)
        self.inertial_pose_in_base = Pose(inertial[3], inertial[4])
        self._base_pose_in_inertial = self.inertial_pose_in_base.inverse()
        self._inertial: Any = None
        self._base = Pose()
        """The frame pose computed from `_inertial`, the last pose that PyBullet returned for the base; both are cached,
        since most bodies rest."""
        self.pose_follower: PoseFollower | None = None
        """Moves the base along the poses of `object_tf`; None if the base is set to these poses, or follows none."""
        self._has_jumped = False
        """Whether the warning that the body moves without a velocity was logged."""
        self.dynamics_changes = 0
        """Number of changes of the dynamics, by which caches of the dynamics notice that they are out of date."""

    @cached_property
    def external_wrenches(self) -> ExternalWrenches:
        """External forces and torques on the links of the body."""
        return ExternalWrenches(self)

    def push(self, wrench: ExternalWrench) -> None:
        """Applies a wrench to a link from the next tick on.

        Raises:
            UnknownNameError: If the body has no such link.
            ValueError: If the body is soft or only visible, the link is static, or a number of the wrench is invalid.
        """
        if self.is_soft or not self.has_physics:
            raise ValueError(f"'{self.name}' is {'soft' if self.is_soft else 'only shown'}: no wrench acts on it")
        self.external_wrenches.set(self.external_wrenches.check(wrench))

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the links, with an empty name for the root; an empty tuple for a soft body."""
        return () if self.is_soft else ("", *map(self.link_name, self.link_indices))

    def link_name(self, index: int) -> str:
        """Returns the name of the link with a given PyBullet index; -1 is the base."""
        return self._link_names[index]

    def dynamics_info(self, link: int) -> tuple[Any, ...]:
        """Returns the result of PyBullet's `getDynamicsInfo` for the link with PyBullet's index `link`.

        For a body in maximal coordinates, PyBullet returns the inertial frame, restitution, stiffness and damping of
        another body. This method replaces the inertial frame by the identity pose, and the other values by the values
        that were configured or set by `change_dynamics`.
        """
        info: tuple[Any, ...] = self.pb.getDynamicsInfo(self.body_id, link)
        if info[10] != MAXIMAL_COORDINATES:
            return info
        restitution, *damping_and_stiffness = (
            self._given_dynamics.get(key, default)
            for key, default in (("restitution", 0.0), ("contactDamping", -1.0), ("contactStiffness", -1.0))
        )
        mass, friction, inertia = info[:3]
        if mass:
            inertia = tuple(moment or math.inf for moment in inertia)  # PyBullet returns 0 for a stored 1/inf
        inertial_frame = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
        front = (mass, friction, inertia, *inertial_frame, restitution)
        return (*front, *info[6:8], *damping_and_stiffness, *info[10:])

    def change_dynamics(self, link: int, **arguments: Any) -> None:
        """Calls PyBullet's `changeDynamics` for the link with PyBullet's index `link`."""
        info = self.dynamics_info(link)
        if info[10] == MAXIMAL_COORDINATES and "localInertiaDiagonal" in arguments:
            arguments.setdefault("mass", info[0])  # without it PyBullet makes the body a static one
        self.pb.changeDynamics(self.body_id, link, **arguments)
        self._given_dynamics.update(arguments)

    def _start_base(
        self, velocity: ResetBaseVelocity | None, object_tf: ObjectTf | None = None, is_fixed: bool = False
    ) -> None:
        """Makes a fixed base follow the TF frame, if one is given; sets the start velocity of a base that is not fixed.

        Logs a warning if a velocity is given for a fixed base, or a TF frame for a base that is not fixed.
        """
        if is_fixed:
            self._follow(object_tf)
            if velocity is not None:
                log.warning("%s: resetBaseVelocity: has no effect: the base is fixed", self.name)
            return
        if velocity is not None:
            self.pb.resetBaseVelocity(self.body_id, **velocity.kwargs())
        if object_tf is not None:
            log.warning("%s: object_tf: has no effect: physics moves a base that is not fixed", self.name)

    def _follow(self, object_tf: ObjectTf | None) -> None:
        """Makes a fixed base follow the poses of a TF frame, if a frame is given.

        PyBullet ignores the velocity of a body in maximal coordinates. Such a body therefore has no `pose_follower`:
        `_jump` moves the body to each pose, and other bodies on top of the body do not move along.
        """
        self.object_tf = object_tf
        if object_tf is not None and self.pb.getDynamicsInfo(self.body_id, -1)[10] == MULTI_BODY:
            centre = self.inertial_pose_in_base
            self.pose_follower = PoseFollower(self.pb, self.name, self.body_id, centre, object_tf)

    def _track(self, object_tf: ObjectTf | None) -> None:
        """Makes the base follow a TF frame, if one is given; while the frame is out of date, physics moves the base."""
        self.object_tf = object_tf
        if object_tf is not None:
            centre = self.inertial_pose_in_base
            self.pose_follower = TrackedBase(self.pb, self.name, self.body_id, centre, object_tf)

    def before_step(self, tick: int) -> None:
        """Called before the physics of each tick; does nothing by default."""

    @property
    def needs_steps(self) -> bool:
        """Whether `before_step` has to be called, if the class defines it."""
        return True

    @property
    def is_idle(self) -> bool:
        """Whether `before_step` has nothing to do until the next input or request."""
        return False

    def halt(self, reason: str) -> None:
        """Aborts all actions in progress, since the world may not run again; does nothing by default."""

    def restart(self) -> bool:
        """Restores the body's initial state, after PyBullet has restored the body's initial poses and velocities.

        Returns:
            Whether the state was restored; False by default. After False, the caller creates the body anew.
        """
        return False

    def resume(self) -> None:
        """Sends the body's settings to PyBullet again, after the body has moved to another client.

        The settings do not include the state of motion and the dynamics. By default, this method does nothing.
        """

    def pause(self, reason: str) -> None:
        """Aborts actions that cannot wait until a stopped world runs again; by default, calls `halt`."""
        self.halt(reason)

    def attach(self, bodies: Mapping[str, Body]) -> None:
        """Attaches this body, which was just added to the world, to other bodies; does nothing by default.

        Args:
            bodies: All bodies in the world, indexed by name.

        Raises:
            ConfigError: If the body cannot be attached.
        """

    def detach(self, name: str | None = None) -> None:
        """Detaches this body from another body, for instance before the other is removed; does nothing by default.

        Args:
            name: Name of the other body; None to remove all attachments.
        """

    @classmethod
    def claims(cls, data: Mapping[str, Any]) -> bool:
        """Returns whether an object's YAML keys describe this type; only called if several types share a `section`."""
        return True

    def sensors(self) -> tuple[Sensor, ...]:
        """Returns the sensors that belong to the body's type, without the sensors listed under `sensors` in YAML."""
        return ()

    def inputs(self) -> Mapping[str, Input]:
        """Returns the inputs of the body, indexed by name.

        The inputs are `pose` if the body follows a TF frame, and `external_wrench` if the body has movable links.
        """
        inputs: dict[str, Input] = {}
        if self.object_tf is not None:
            apply = self._jump if self.pose_follower is None else self.pose_follower.push
            is_tracked = isinstance(self.pose_follower, TrackedBase)
            inputs["pose"] = PoseInput.following(self.object_tf, apply, is_tracked)
        if self.has_physics and not self.is_soft and self.external_wrenches.can_act:
            inputs["external_wrench"] = Input(self.external_wrenches.check, self.external_wrenches.set)
        return inputs

    def inertial_pose(self, index: int) -> Pose:
        """Returns the pose of a link's inertial frame (centre of mass and principal axes) in its URDF frame.

        Args:
            index: PyBullet's index of the link, -1 for the base.
        """
        return self.inertial_pose_in_base if index < 0 else Pose(*self.pb.getLinkState(self.body_id, index)[2:4])

    def link_pose(self, index: int) -> Pose:
        """Returns the pose of a link's URDF frame in the world frame.

        Args:
            index: PyBullet's index of the link, -1 for the base.
        """
        if index >= 0:
            return Pose(*self.pb.getLinkState(self.body_id, index, computeForwardKinematics=1)[4:6])
        inertial = self.pb.getBasePositionAndOrientation(self.body_id)
        if inertial != self._inertial:
            self._inertial, self._base = inertial, Pose(*inertial) @ self._base_pose_in_inertial
        return self._base

    def base_pose(self) -> Pose:
        """Returns the pose of the base link's URDF frame in the world frame."""
        return self.link_pose(-1)

    def set_base_pose(self, pose: Pose) -> None:
        """Sets the pose of the base link's URDF frame in the world frame."""
        self.pb.resetBasePositionAndOrientation(self.body_id, *(pose @ self.inertial_pose_in_base))

    def _jump(self, pose: Pose) -> None:
        """Moves the base to `pose` in one step, with zero velocity; logs a warning once if the body is in contact."""
        if self.has_physics and not self._has_jumped and self.pb.getContactPoints(self.body_id):
            self._has_jumped = True
            log.warning(
                "%s: object_tf: moves without a velocity, because of useMaximalCoordinates: it pushes other bodies, "
                "but neither carries them nor has friction with them; remove useMaximalCoordinates",
                self.name,
            )
        self.set_base_pose(pose)

    def base_twist(self) -> Twist:
        """Returns the twist of the base link's URDF frame, in the axes of the world frame."""
        linear, angular = self.pb.getBaseVelocity(self.body_id)  # of the centre of mass
        centre = self.pb.getBasePositionAndOrientation(self.body_id)[0]
        return Twist(plus(linear, cross(angular, minus(self.base_pose().position, centre))), angular)

    def teleport(self, pose: Pose) -> None:
        """Moves the base link's URDF frame to a pose in the world frame, and sets the base's velocity to zero."""
        self.set_base_pose(pose)
        self.pb.resetBaseVelocity(self.body_id, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        if self.pose_follower is not None:
            self.pose_follower.put(pose)

    def state(self) -> BodyState:
        """Returns the pose of the base's inertial frame in the world frame, and the joint positions."""
        position, quat = self.pb.getBasePositionAndOrientation(self.body_id)
        joints = self.pb.getJointStates(self.body_id, self.joint_indices) if self.joint_indices else ()
        positions = [joint[0] for joint in joints]
        for index in self._ball_joints:
            positions[index] = self.pb.getJointStateMultiDof(self.body_id, index)[0]
        return BodyState(self.name, position + quat, tuple(positions))

    @cached_property
    def _ball_joints(self) -> tuple[int, ...]:
        """PyBullet's indices of the spherical joints."""
        types = [self.pb.getJointInfo(self.body_id, index)[2] for index in self.joint_indices]
        return tuple(index for index, kind in zip(self.joint_indices, types) if kind == pybullet.JOINT_SPHERICAL)

    def motion_state(self) -> tuple[float, ...]:
        """Returns the complete state of motion, for bitwise comparison.

        Returns:
            Position, orientation and velocities of the base, then positions and velocities of all joints.
        """
        position, quat = self.pb.getBasePositionAndOrientation(self.body_id)
        linear, angular = self.pb.getBaseVelocity(self.body_id)
        joints = self.pb.getJointStatesMultiDof(self.body_id, self.joint_indices) if self.joint_indices else ()
        return (*position, *quat, *linear, *angular, *(each for joint in joints for part in joint[:2] for each in part))

    def close(self) -> None:
        """Closes the body's resources outside of the world, such as other PyBullet clients; by default does nothing."""

    def remove(self) -> None:
        """Removes the body from the world."""
        self.close()
        self.pb.removeBody(self.body_id)
