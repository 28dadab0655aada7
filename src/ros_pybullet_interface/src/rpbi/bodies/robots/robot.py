"""Robots: jointed bodies whose motors hold and follow targets."""

import re
from collections.abc import Mapping
from typing import Any

import pybullet

from custom_ros_tools.errors import Problem
from rpbi.control.gravity import GravityModel
from rpbi.control.joint_drive import JointDrive
from rpbi.control.motors import Command, LimitReports, Motors
from rpbi.control.trajectories.config import trajectory_problems
from rpbi.control.trajectories.follower import TrajectoryFollower
from rpbi.engine.client import Client
from rpbi.engine.inputs import Input
from rpbi.geometry import Pose
from rpbi.sensors.contact_arrows import contact_sensors
from rpbi.sensors.force_torque import ForceTorqueSensor
from rpbi.sensors.joint_state import JointStateSensor
from rpbi.sensors.sensor import Sensor
from rpbi.sensors.trajectory_state import TrajectoryStateSensor
from rpbi.urdf.joints import JointTarget

from .jointed import JointedBody
from .robot_config import RobotConfig


class Robot(JointedBody):
    """A robot with motors, within the effort and velocity limits of its URDF.

    It holds its start position until the first target. Targets of joints that a motion drives are refused until it
    ends.
    """

    example = {
        "loadURDF": {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True},
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        "broadcast_link_states": True,
        "base_state_hz": 50.0,
        "enabled_joint_force_torque_sensors": ["lbr_iiwa_joint_7"],
        "joint_trajectory_controller": {},
        "start_ik_callback": True,
        "contacts": {},
        "object_tf": {"tf_id": "FRAME"},
    }

    def __init__(self, pb: Client, config: RobotConfig) -> None:
        super().__init__(pb, config)
        assert config.setJointMotorControlArray is not None  # the model demands it
        mode = config.setJointMotorControlArray.controlMode
        self.motors = Motors(
            pb,
            self.body_id,
            self.model,
            mode,
            self._gains(),
            LimitReports(self.name),
            config.enforce_effort_limits,
            config.target_timeout_s,
        )
        self.drive = JointDrive(self.name, pb, self.body_id, self.model, self.motors)
        self.force_torque_sensors = tuple(
            ForceTorqueSensor(self, self.model[each.joint], each, config.joint_state_publisher_hz)
            for each in config.enabled_joint_force_torque_sensors
        )
        follower = config.joint_trajectory_controller
        self.follower = None if follower is None else TrajectoryFollower(self.drive, follower)
        self._gravity = GravityModel(pb, self.model, config.loadURDF) if config.gravity_compensation else None
        self._start_base(config.resetBaseVelocity, config.object_tf, self.has_fixed_base)

    @classmethod
    def claims(cls, data: Mapping[str, Any]) -> bool:
        """Tells whether a YAML of the section `robots` is that of a robot with motors whose base does not drive."""
        return data.get("is_visual_robot") not in (True, 1) and data.get("planar_base") is None

    def sensors(self) -> tuple[Sensor, ...]:
        """Joint states, force-torque sensors, the follower's state and contacts, beside link poses."""
        hz = self.config.joint_state_publisher_hz
        joint_states = (JointStateSensor(self, hz),) if hz else ()
        trajectory = () if self.follower is None else (TrajectoryStateSensor(self.drive, self.follower),)
        contacts = contact_sensors(self, self.config.contacts)
        return (*joint_states, *self.force_torque_sensors, *trajectory, *contacts, *super().sensors())

    def inputs(self) -> Mapping[str, Input]:
        """Takes `target`, a JointTarget of what the control mode asks for, beside the pose of its base."""
        target = Input(self._check_target, self.motors.follow, merge=Command.merged)
        return {**super().inputs(), "target": target}

    def before_step(self, tick: int) -> None:
        """Follows the motion, lets targets expire and applies efforts."""
        self.drive.advance(tick)
        holding: Mapping[int, float] = {}
        if self._gravity is not None and self.motors.mode == pybullet.TORQUE_CONTROL:
            holding = self._gravity.efforts(self.base_pose(), self.joint_positions())
        self.motors.before_step(tick, holding)

    def halt(self, reason: str) -> None:
        """Ends the motion that runs, if any; its joints hold where they are."""
        self.drive.halt(reason)

    def pause(self, reason: str) -> None:
        """Ends the motion that runs, unless it can wait until the world runs again."""
        if self.drive.motion is not None and not self.drive.motion.can_wait:
            self.halt(reason)

    def switch_mode(self, mode: int) -> None:
        """Changes PyBullet's control mode, if it is another one; a motion that runs is ended."""
        if mode != self.motors.mode:
            self.halt("the control mode was changed")
            self.motors.switch(mode)

    def set_joint_state(self, target: JointTarget) -> None:
        """Puts joints somewhere at once, where the motors then hold them; a motion that runs is ended."""
        super().set_joint_state(target)
        self.halt("its joints were put elsewhere")
        self.motors.rest(self.model.resolve(target.names, target.position))

    def teleport(self, pose: Pose) -> None:
        """Puts the base link's URDF frame at a pose in the world, at rest; a motion that runs is ended."""
        self.halt("the robot was put elsewhere")
        super().teleport(pose)

    def efforts(self, reported: tuple[float, ...]) -> tuple[float, ...]:
        """Returns the motors' efforts [N m or N] of all joints; PyBullet does not report those of torque control."""
        if self.motors.mode != pybullet.TORQUE_CONTROL:
            return reported
        return tuple(self.motors.applied_efforts.get(joint.index, 0.0) for joint in self.joints)

    def remove(self) -> None:
        """Takes the robot out of the world; a motion that runs is ended."""
        self.halt("the robot was removed")
        if self._gravity is not None:
            self._gravity.close()
        super().remove()

    def _check_target(self, target: JointTarget) -> Command:
        command = self.motors.check(target)
        motion = self.drive.motion
        driven = [] if motion is None else [self.model.joints[i].name for i in command.values if i in motion.joints]
        if driven:
            raise ValueError(f"a motion drives {', '.join(driven)} until it ends")
        return command

    def _gains(self) -> dict[int, dict[str, float]]:
        """Returns PyBullet's gains by joint index; what does not fit was found before."""
        gains: dict[int, dict[str, float]] = {}
        for key, given in self._configured_gains().items():
            argument = key.removesuffix("s")
            if isinstance(given, Mapping):
                by_index = {self.model[name].index: gain for name, gain in given.items()}
            else:
                by_index = {joint.index: given[i % len(given)] for i, joint in enumerate(self.model.driven)}
            for index, gain in by_index.items():
                gains.setdefault(index, {})[argument] = gain
        return gains

    def _configured_gains(self) -> dict[str, tuple[float, ...] | dict[str, float]]:
        motors = self.config.setJointMotorControlArray
        given = {key: getattr(motors, key) for key in ("positionGains", "velocityGains")}
        return {key: gains for key, gains in given.items() if gains is not None}

    def _problems(self) -> list[Problem]:
        driven = [joint.name for joint in self.model.driven]
        problems = super()._problems()
        problems += trajectory_problems(self.name, self.config.joint_trajectory_controller, driven)
        for key, gains in self._configured_gains().items():
            path = f"setJointMotorControlArray.{key}"
            if isinstance(gains, Mapping):
                problems += self._unknown_joints({f"{path}.{name}": name for name in gains})
            elif len(gains) not in (1, len(driven)):
                message = f"expected 1 number or {len(driven)}, one for each of {', '.join(driven)}; got {len(gains)}"
                problems.append(Problem(self.name, path, message))
        return [*problems, *self._force_torque_problems(), *self._gravity_problems()]

    def _gravity_problems(self) -> list[Problem]:
        """PyBullet's inverse dynamics know joints of one axis only."""
        others = [joint.name for joint in self.joints if not (joint.is_driven or joint.is_fixed)]
        if not (self.config.gravity_compensation and others):
            return []
        message = f"works with revolute, prismatic and fixed joints only; there are {', '.join(others)}"
        return [Problem(self.name, "gravity_compensation", message)]

    def _force_torque_problems(self) -> list[Problem]:
        problems = []
        joints = [each.joint for each in self.config.enabled_joint_force_torque_sensors]
        for index, joint in enumerate(joints):
            key = f"enabled_joint_force_torque_sensors[{index}]"
            if joint in joints[:index]:
                problems.append(Problem(self.name, key, f"joint '{joint}' has a sensor already; one joint has one"))
            if not re.fullmatch(r"\w+", joint, re.ASCII):
                message = f"topics are named after joint '{joint}', which only letters, digits and '_' allow"
                problems.append(Problem(self.name, key, message))
            problems += self._unknown_joints({key: joint})
        return problems
