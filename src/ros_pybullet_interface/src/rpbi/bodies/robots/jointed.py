"""Base class of all robots, simulated or visual."""

import logging
import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from robot_model.urdf.document import mimics_of
from robot_model.urdf.for_pybullet import for_pybullet
from rpbi.bodies.body import Body
from rpbi.control.joint_command import JointCommand
from rpbi.engine.client import Client
from rpbi.kinematics import Kinematics
from rpbi.sensors.base_state import BaseStateSensor
from rpbi.sensors.force_torque import ForceTorqueSensor
from rpbi.sensors.link_pose import LinkPoseSensor
from rpbi.sensors.sensor import Sensor
from rpbi.urdf.joints import Joint, JointModel
from rpbi.urdf.loading import load_urdf, prepared_urdf

from .robot_config import RobotConfig

log = logging.getLogger(__name__)

START_TOLERANCE = 1e-3
"""Largest difference [rad or m] between a mimic joint's configured and actual start position; beyond it, a warning is
logged."""
DEFAULT_BASE_STATE_HZ = 50.0
"""Default rate [Hz] of the base state of a robot whose base is not fixed."""


class JointedBody(Body):
    """A robot from a URDF, created at its start position.

    Raises:
        ConfigError: If the configuration does not fit the robot.
        PhysicsError: If PyBullet cannot load the robot.
    """

    Config = RobotConfig
    section = "robots"
    not_in_keyframes = (*Body.not_in_keyframes, "kinematics")
    force_torque_sensors: tuple[ForceTorqueSensor, ...] = ()
    base_joints: ClassVar[int] = 0
    """Number of joints that `prepare_urdf` adds between the world and the root link."""
    prepare_urdf = staticmethod(for_pybullet)
    """Function that converts the configured URDF to the URDF that PyBullet reads."""
    fixes_base: ClassVar[bool] = False
    """Whether PyBullet fixes the base regardless of the configuration."""

    @classmethod
    def prepare(cls, config: RobotConfig, has_window: bool) -> None:
        """Prepares the files that PyBullet reads instead of the URDF."""
        prepared_urdf(cls._load_arguments(config), cls.prepare_urdf, has_window)

    @classmethod
    def _load_arguments(cls, config: RobotConfig) -> dict[str, Any]:
        arguments = config.loadURDF.kwargs()
        return {**arguments, "useFixedBase": True} if cls.fixes_base else arguments

    def __init__(self, pb: Client, config: RobotConfig) -> None:
        arguments = self._load_arguments(config)
        self.has_fixed_base = bool(arguments.get("useFixedBase", False)) and not self.base_joints
        inertia_from_urdf = config.inertia_from_urdf and not config.is_visual_robot  # a visual robot has no mass
        body_id = load_urdf(pb, config.name, arguments, self.prepare_urdf, inertia_from_urdf)
        super().__init__(pb, config.name, body_id)
        self.config = config
        joints = Joint.all_of(pb, self.body_id)
        self.model = self._joint_model(joints)
        self.joints = self.model.own
        self.link_indices = tuple(joint.index for joint in self.joints)
        if self.base_joints:
            self.root_link = joints[self.base_joints - 1].link
        if problems := self._problems():
            raise ConfigError(problems)
        starts = self.model.with_mimic_joints(self.start_positions())
        for index in self.model.couplings:
            self._compare_start(self.model.joints[index], starts[index])
        self._put_joints(starts)
        if config.color_alpha is not None:
            self._set_alpha(config.color_alpha)

    def sensors(self) -> tuple[Sensor, ...]:
        """Returns the configured sensors of the link poses (all links or only the root) and of the base state."""
        sensors: list[Sensor] = []
        if self.config.broadcast_link_states:
            sensors.append(LinkPoseSensor(self, self.config.broadcast_link_states_hz))
        elif self.config.broadcast_root_tf_hz:
            sensors.append(LinkPoseSensor(self, self.config.broadcast_root_tf_hz, links=False))
        base_state_hz = self.config.base_state_hz
        if base_state_hz is None and not self.has_fixed_base:
            base_state_hz = DEFAULT_BASE_STATE_HZ
        if base_state_hz:
            sensors.append(BaseStateSensor(self, base_state_hz))
        return tuple(sensors)

    @cached_property
    def kinematics(self) -> Kinematics:
        """Kinematics of the robot, created at the first use, in a separate PyBullet client; any thread may use them."""
        load = self.config.loadURDF
        return Kinematics(load.fileName, load.globalScaling or 1.0, load.flags or 0)

    def start_positions(self) -> dict[int, float]:
        """Returns the start position [rad or m] of each driven joint, indexed by PyBullet's joint index."""
        return {joint.index: self._start_of(joint) for joint in self.model.driven}

    def _start_of(self, joint: Joint) -> float:
        start = self.config.initial_joint_position.get(joint.name, 0.0)
        in_degrees = self.config.initial_revolute_joint_positions_are_deg and joint.is_revolute
        return math.radians(start) if in_degrees else start

    def joint_positions(self) -> dict[int, float]:
        """Returns the measured positions [rad or m] of all joints with one axis, indexed by PyBullet's joint index."""
        indices = [joint.index for joint in self.model.moving]
        states = self.pb.getJointStates(self.body_id, indices) if indices else ()
        return {index: state[0] for index, state in zip(indices, states)}

    def efforts(self, reported: tuple[float, ...]) -> tuple[float, ...]:
        """Returns the motor efforts [N m or N] of all joints; by default the efforts that PyBullet reports."""
        return reported

    def set_joint_state(self, target: JointCommand) -> None:
        """Sets positions [rad or m] and velocities [rad/s or m/s] of joints at once.

        If the target has no velocities, the velocities are set to 0.

        Raises:
            UnknownNameError: If the robot lacks one of the joints.
            ValueError: If a number is missing, not finite or outside the joint's limits.
        """
        positions = self.model.resolve_driven(target.names, target.position)
        velocities = self.model.resolve(target.names, target.velocity) if target.velocity else {}
        self.model.check_limits(positions)
        for index, velocity in velocities.items():
            joint = self.model.joints[index]
            if abs(velocity) > joint.max_velocity:
                limit = f"{joint.max_velocity:g} {joint.unit}/s"
                raise ValueError(f"velocity of joint '{joint.name}' must be within +-{limit}, got {velocity:g}")
        velocities = {index: velocities.get(index, 0.0) for index in positions}
        self._put_joints(
            self.model.with_mimic_joints(positions), self.model.with_mimic_joints(velocities, offsets=False)
        )

    def close(self) -> None:
        """Closes the robot's kinematics."""
        if "kinematics" in vars(self):
            self.kinematics.close()

    def _put_joints(self, positions: Mapping[int, float], velocities: Mapping[int, float] | None = None) -> None:
        """Sets positions and velocities of joints in one call of PyBullet.

        A single call saves time, since each call takes milliseconds if there is a window but no graphics card.

        Args:
            positions: Positions [rad or m], indexed by PyBullet's joint index.
            velocities: Velocities [rad/s or m/s], indexed likewise; missing velocities are set to 0.
        """
        rates = velocities or {}
        values, speeds = [[each] for each in positions.values()], [[rates.get(index, 0.0)] for index in positions]
        self.pb.resetJointStatesMultiDof(self.body_id, [*positions], values, speeds)

    def _joint_model(self, joints: list[Joint]) -> JointModel:
        """Returns a model of the joints, including the mimic joints of the URDF and of the key `coupled_joints`.

        Raises:
            ConfigError: If a joint cannot follow another joint.
        """
        coupled = self.config.coupled_joints
        names = {joint.name for joint in joints[self.base_joints :]}
        problems = [
            Problem(self.name, f"coupled_joints.{name}", str(UnknownNameError("joint", name, sorted(names))))
            for name in coupled
            if name not in names
        ]
        if problems:
            raise ConfigError(problems)
        try:
            mimics = mimics_of(self.config.loadURDF.fileName)
            mimics.update({name: each.mimic for name, each in coupled.items()})
            return JointModel(joints, self.base_joints, mimics)
        except ValueError as error:
            key = "coupled_joints" if coupled else "loadURDF.fileName"
            raise ConfigError([Problem(self.name, key, str(error))]) from None

    def _problems(self) -> list[Problem]:
        """Returns a problem for each part of the configuration that does not fit this robot."""
        configured = self.config.initial_joint_position
        if problems := self._unknown_joints({f"initial_joint_position.{name}": name for name in configured}):
            return problems
        starts = ((self.model.joints[index], position) for index, position in self.start_positions().items())
        return [
            Problem(self.name, f"initial_joint_position.{joint.name}", joint.limit_violation(position))
            for joint, position in starts
            if joint.name in configured and not joint.allows(position)
        ]

    def _compare_start(self, follower: Joint, position: float) -> None:
        """Logs a warning if the configured start position of a mimic joint differs from its actual position.

        Args:
            follower: The mimic joint.
            position: The actual start position [rad or m], computed from the mimicked joint.
        """
        configured = self._start_of(follower)
        if follower.name in self.config.initial_joint_position and abs(configured - position) > START_TOLERANCE:
            leader = self.model.joints[self.model.couplings[follower.index].leader].name
            log.warning(
                "%s: initial_joint_position.%s: has no effect: it follows '%s' and starts at %.6g %s",
                *(self.name, follower.name, leader, position, follower.unit),
            )

    def _unknown_joints(self, names: Mapping[str, str]) -> list[Problem]:
        """Returns a problem for each joint name that the robot lacks.

        Args:
            names: Joint names, each indexed by the configuration key that contains the name.
        """
        problems = []
        for key, name in names.items():
            try:
                self.model[name]
            except UnknownNameError as error:
                problems.append(Problem(self.name, key, str(error)))
        return problems

    def _set_alpha(self, alpha: float) -> None:
        """Sets the opacity of all visual shapes, from 0 to 1."""
        for shape in self.pb.getVisualShapeData(self.body_id):
            self.pb.changeVisualShape(self.body_id, shape[1], rgbaColor=(*shape[7][:3], alpha))
