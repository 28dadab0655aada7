"""What robots that move and robots that are only shown have in common."""

import math
from collections.abc import Mapping
from functools import cached_property
from typing import ClassVar

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from rpbi.bodies.body import Body
from rpbi.engine.client import Client
from rpbi.kinematics import Kinematics
from rpbi.sensors.base_state import BaseStateSensor
from rpbi.sensors.force_torque import ForceTorqueSensor
from rpbi.sensors.link_pose import LinkPoseSensor
from rpbi.sensors.sensor import Sensor
from rpbi.urdf.files import resolve_meshes
from rpbi.urdf.joints import Joint, JointModel, JointTarget
from rpbi.urdf.loading import load_urdf

from .robot_config import RobotConfig

DEFAULT_BASE_STATE_HZ = 50.0
"""Rate of the state of a base that physics moves [Hz]."""


class JointedBody(Body):
    """A body that comes from a URDF and stands at its start position.

    Args:
        fixed_base: Whether its base is fixed, whatever the configuration says.

    Raises:
        ConfigError: If the configuration does not fit the robot.
        PhysicsError: If PyBullet cannot load it.
    """

    Config = RobotConfig
    section = "robots"
    force_torque_sensors: tuple[ForceTorqueSensor, ...] = ()
    base_joints: ClassVar[int] = 0
    """How many joints `prepare_urdf` puts between the world and the root link."""
    prepare_urdf = staticmethod(resolve_meshes)
    """Returns a URDF file that PyBullet can load in place of the configured one."""

    def __init__(self, pb: Client, config: RobotConfig, fixed_base: bool = False) -> None:
        arguments = config.loadURDF.kwargs()
        if fixed_base or self.base_joints:
            arguments["useFixedBase"] = True
        self.has_fixed_base = bool(arguments.get("useFixedBase", False)) and not self.base_joints
        inertia_from_urdf = config.inertia_from_urdf and not config.is_visual_robot  # which has no mass
        body_id = load_urdf(pb, config.name, arguments, self.prepare_urdf, inertia_from_urdf)
        super().__init__(pb, config.name, body_id)
        self.config = config
        joints = Joint.all_of(pb, self.body_id)
        self.model = JointModel(joints, self.base_joints)
        self.joints = self.model.own
        self.link_indices = tuple(joint.index for joint in self.joints)
        if self.base_joints:
            self.root_link = joints[self.base_joints - 1].link
        if problems := self._problems():
            raise ConfigError(problems)
        self._put_joints(self.start_positions())
        if config.color_alpha is not None:
            self._set_alpha(config.color_alpha)

    def sensors(self) -> tuple[Sensor, ...]:
        """Link poses, or that of the root link alone, if they are to be broadcast, and the state of the base."""
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
        """Its kinematics in a client of their own, for any thread; made when first asked for."""
        load = self.config.loadURDF
        return Kinematics(load.fileName, load.globalScaling or 1.0, load.flags or 0)

    def start_positions(self) -> dict[int, float]:
        """Returns the start position [rad or m] of each driven joint by index."""
        in_degrees = self.config.initial_revolute_joint_positions_are_deg
        starts = ((joint, self.config.initial_joint_position.get(joint.name, 0.0)) for joint in self.model.driven)
        return {joint.index: math.radians(q) if in_degrees and joint.is_revolute else q for joint, q in starts}

    def joint_positions(self) -> dict[int, float]:
        """Returns the measured position [rad or m] of each driven joint by index."""
        indices = [joint.index for joint in self.model.driven]
        states = self.pb.getJointStates(self.body_id, indices) if indices else ()
        return {index: state[0] for index, state in zip(indices, states)}

    def efforts(self, reported: tuple[float, ...]) -> tuple[float, ...]:
        """Returns the motors' efforts [N m or N] of all joints, of which PyBullet reported some."""
        return reported

    def set_joint_state(self, target: JointTarget) -> None:
        """Puts joints at positions [rad or m] with velocities [rad/s or m/s], 0 where none is given, at once.

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
        self._put_joints(positions, velocities)

    def remove(self) -> None:
        """Takes it out of the world, and its kinematics with it."""
        if "kinematics" in vars(self):
            self.kinematics.close()
        super().remove()

    def _put_joints(self, positions: Mapping[int, float], velocities: Mapping[int, float] | None = None) -> None:
        """Puts joints by index at positions [rad or m] with velocities, 0 where none is given, in one call of PyBullet.

        With a window and no graphics card, a call takes milliseconds.
        """
        rates = velocities or {}
        values, speeds = [[each] for each in positions.values()], [[rates.get(index, 0.0)] for index in positions]
        self.pb.resetJointStatesMultiDof(self.body_id, [*positions], values, speeds)

    def _problems(self) -> list[Problem]:
        """Returns what in the configuration does not fit the robot."""
        configured = self.config.initial_joint_position
        if problems := self._unknown_joints({f"initial_joint_position.{name}": name for name in configured}):
            return problems
        starts = ((self.model.joints[index], position) for index, position in self.start_positions().items())
        return [
            Problem(self.name, f"initial_joint_position.{joint.name}", joint.limit_violation(position))
            for joint, position in starts
            if joint.name in configured and not joint.allows(position)
        ]

    def _unknown_joints(self, names: Mapping[str, str]) -> list[Problem]:
        """Returns a problem for each name, by the key that has it, that is no joint's."""
        problems = []
        for key, name in names.items():
            try:
                self.model[name]
            except UnknownNameError as error:
                problems.append(Problem(self.name, key, str(error)))
        return problems

    def _set_alpha(self, alpha: float) -> None:
        """Makes every visual shape as opaque as asked."""
        for shape in self.pb.getVisualShapeData(self.body_id):
            self.pb.changeVisualShape(self.body_id, shape[1], rgbaColor=(*shape[7][:3], alpha))
