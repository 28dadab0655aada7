"""Robots with motors, which follow and hold joint targets."""

import logging
import re
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pybullet

from custom_ros_tools.errors import Problem
from rpbi.config.pybullet_args import IMPEDANCE_CONTROL
from rpbi.control.controllers.controller import ControlledRobot, RobotState
from rpbi.control.controllers.impedance import JointImpedance
from rpbi.control.controllers.manager import ControllerManager, ControllerSwitch, controller_problems
from rpbi.control.joint_command import JointCommand
from rpbi.control.joint_drive import JointDrive
from rpbi.control.motors import QUANTITIES, LimitReports, Motors, ResolvedCommand, coalesce
from rpbi.control.robot_dynamics import RobotDynamics
from rpbi.control.trajectories.config import trajectory_problems
from rpbi.control.trajectories.follower import TrajectoryFollower
from rpbi.engine.client import Client
from rpbi.engine.inputs import Input
from rpbi.geometry import Pose, Twist
from rpbi.sensors.contacts.arrows import contact_sensors
from rpbi.sensors.controller_state import ControllerStateSensor
from rpbi.sensors.force_torque import ForceTorqueSensor
from rpbi.sensors.joint_state import JointStateSensor
from rpbi.sensors.sensor import Sensor
from rpbi.sensors.trajectory_state import TrajectoryStateSensor
from rpbi.urdf.joints import couple

from .jointed import JointedBody
from .robot_config import RobotConfig

log = logging.getLogger(__name__)


class Robot(JointedBody):
    """A robot with motors, which respect the effort and velocity limits of the URDF.

    The robot holds its start position until the first target. While a timed motion drives joints, targets for these
    joints are refused.
    """

    example = {
        "loadURDF": {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True},
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        "broadcast_link_states": True,
        "base_state_hz": 50.0,
        "enabled_joint_force_torque_sensors": ["lbr_iiwa_joint_7"],
        "controllers": {
            "springs": {"type": "joint_impedance", "active": False},
            "press": {"type": "force", "link": "lbr_iiwa_link_7", "active": False},
        },
        "joint_trajectory_controller": {},
        "start_ik_callback": True,
        "contacts": {},
        "object_tf": {"tf_id": "FRAME"},
    }

    def __init__(self, pb: Client, config: RobotConfig) -> None:
        self._robot_model: RobotDynamics | None = None
        super().__init__(pb, config)
        assert config.setJointMotorControlArray is not None  # required by the model
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
        couple(pb, self.body_id, self.model.couplings)
        self._warned_mimic = not self.model.couplings
        self.drive = JointDrive(
            self.name,
            pb,
            self.body_id,
            self.model,
            self.motors,
            config.target_interpolation,
            config.target_buffer_s,
        )
        self.force_torque_sensors = tuple(
            ForceTorqueSensor(self, self.model[each.joint], each, config.joint_state_publisher_hz)
            for each in config.enabled_joint_force_torque_sensors
        )
        follower = config.joint_trajectory_controller
        self.follower = None if follower is None else TrajectoryFollower(self.drive, follower)
        self.controllers = ControllerManager(self._controlled_robot(), config.controllers, self.motors)
        self.drive.controlled = lambda: self.controllers.driven
        self._springs = JointImpedance(config.impedance, self.model.driven, self.drive.dt_s)
        self._start_base(config.resetBaseVelocity, config.object_tf, self.has_fixed_base)

    @classmethod
    def claims(cls, data: Mapping[str, Any]) -> bool:
        """Returns whether a YAML object of the section `robots` is neither a visual nor a mobile robot."""
        return data.get("is_visual_robot") not in (True, 1) and data.get("planar_base") is None

    def sensors(self) -> tuple[Sensor, ...]:
        """Returns the configured sensors.

        The sensors measure joint states, controller states, forces and torques in joints, the trajectory follower's
        state, contacts, link poses and the state of the base.
        """
        hz = self.config.joint_state_publisher_hz
        joint_states = (JointStateSensor(self, hz),) if hz else ()
        trajectory = () if self.follower is None else (TrajectoryStateSensor(self.drive, self.follower),)
        contacts = contact_sensors(self, self.config.contacts)
        controllers = (
            ControllerStateSensor(self.name, self.controllers, name, each.state_hz)
            for name, each in self.config.controllers.items()
            if each.state_hz
        )
        return (*joint_states, *controllers, *self.force_torque_sensors, *trajectory, *contacts, *super().sensors())

    def inputs(self) -> Mapping[str, Input]:
        """Returns the inputs of the robot, indexed by name.

        Besides the inputs of a `Body`, there are `target` and the inputs of the controllers. A value of `target` is a
        JointCommand, or a mapping from joint names to positions, velocities or efforts, depending on the control mode.
        """
        target = Input(self._check_target, self.drive.follow, merge=coalesce)
        return {**super().inputs(), "target": target, **self._controller_inputs()}

    def before_step(self, tick: int) -> None:
        """Advances the running motion and the controllers, drops expired targets, and applies efforts."""
        self.drive.advance(tick)
        mode, driven = self.motors.mode, self.controllers.driven
        holding: Mapping[int, float] = {}
        if (
            driven
            or mode == IMPEDANCE_CONTROL
            or (mode == pybullet.TORQUE_CONTROL and self.config.gravity_compensation)
        ):
            state = self._state()
            if driven:
                self.controllers.advance(state, tick)
            if mode == IMPEDANCE_CONTROL:
                self._spring(state)
            elif mode == pybullet.TORQUE_CONTROL and self.config.gravity_compensation:
                efforts = self.robot_model.gravity(state.base, state.position)
                holding = {joint.index: effort for joint, effort in zip(self.model.driven, efforts.tolist())}
        self.motors.before_step(tick, holding, self.controllers.driven)

    @property
    def is_idle(self) -> bool:
        """Whether all motors hold their positions or velocities, so that `before_step` has nothing to do."""
        is_plain = type(self).before_step is Robot.before_step and not self.controllers.driven
        return is_plain and self.drive.is_idle and self.motors.is_idle

    @property
    def robot_model(self) -> RobotDynamics:
        """Dynamics and kinematics of the robot, created at the first use."""
        if self._robot_model is None:
            config = self.config
            self._robot_model = RobotDynamics(self.pb, self.model, config.loadURDF, config.inertia_from_urdf)
        return self._robot_model

    def switch_controllers(self, switch: ControllerSwitch) -> None:
        """Stops and starts controllers; a running motion ends if it moves joints of the started controllers.

        Raises:
            UnknownNameError: If the robot lacks one of the controllers.
            ValueError: If two controllers would drive the same joint; all controllers then stay as they were.
        """
        taken = self.controllers.switch(switch)
        if self.drive.motion is not None and taken & self.drive.motion.joints:
            self.halt("a controller drives its joints")
            self.motors.disable(taken)
        self.drive.drop_targets(taken)

    def halt(self, reason: str) -> None:
        """Ends the running motion, if any; the moving joints then hold their present positions."""
        self.drive.halt(reason)

    def pause(self, reason: str) -> None:
        """Ends the running motion, unless the motion can continue when the world runs again."""
        if self.drive.motion is not None and not self.drive.motion.can_wait:
            self.halt(reason)

    def restart(self) -> bool:
        """Makes the motors hold the start position again, after a reset.

        Returns:
            True after success. False, without a change, if the robot has controllers, a trajectory follower or
            force-torque sensors; the caller then creates the robot anew.
        """
        if self.controllers.names or self.follower is not None or self.force_torque_sensors:
            return False
        self.halt("the world was reset")
        self.drive.drop_targets()
        self.motors.switch(self.motors.mode)
        self._springs.restart()
        return True

    def resume(self) -> None:
        """Sends the state of the motors to PyBullet again."""
        self.motors.resume()

    def switch_mode(self, mode: int) -> None:
        """Changes the control mode of the motors, and ends the running motion; does nothing if the mode is the same."""
        if mode != self.motors.mode:
            self.halt("the control mode was changed")
            self.drive.drop_targets()
            self.motors.switch(mode)
            self._springs.restart()
            self.motors.disable(self.controllers.driven)

    def set_joint_state(self, target: JointCommand) -> None:
        """Sets joint states at once, makes the motors hold the new positions, and ends the running motion."""
        super().set_joint_state(target)
        self.halt("its joints were set to other positions")
        positions = self.model.resolve(target.names, target.position)
        self.drive.drop_targets(positions)
        self.motors.reset_setpoints(positions)
        self.motors.disable(self.controllers.driven & positions.keys())

    def teleport(self, pose: Pose) -> None:
        """Moves the base link's URDF frame to a pose in the world frame with zero velocity; ends the running motion."""
        self.halt("the robot was moved to another pose")
        super().teleport(pose)

    def efforts(self, reported: tuple[float, ...]) -> tuple[float, ...]:
        """Returns the motor efforts [N m or N] of all joints.

        Args:
            reported: Efforts that PyBullet reports for all joints. They lack efforts that this class has applied.
        """
        applied = self.motors.applied_efforts
        if not applied:
            return reported
        return tuple(applied.get(joint.index, effort) for joint, effort in zip(self.joints, reported))

    def remove(self) -> None:
        """Ends the running motion and removes the robot from the world."""
        self.halt("the robot was removed")
        super().remove()

    def close(self) -> None:
        """Closes the robot's kinematics and dynamics."""
        super().close()
        if self._robot_model is not None:
            self._robot_model.close()

    def _check_target(self, given: JointCommand | Mapping[str, float]) -> tuple[ResolvedCommand]:
        target = JointCommand.of(given, QUANTITIES[self.motors.mode])
        command = self.motors.check(target)
        if not self._warned_mimic:
            self._warn_mimic(target.names)
        motion = self.drive.motion
        driven = [] if motion is None else [self.model.joints[i].name for i in command.values if i in motion.joints]
        if driven:
            raise ValueError(f"a motion drives {', '.join(driven)} until it ends")
        driven = [self.model.joints[i].name for i in command.values if i in self.controllers.driven]
        if driven:
            raise ValueError(f"a controller drives {', '.join(driven)} until it is stopped")
        return (command,)

    def _state(self) -> RobotState:
        measured = self.drive.measured()
        positions, velocities = zip(*measured.values()) if measured else ((), ())
        twist = Twist() if self.has_fixed_base else self.base_twist()
        return RobotState(self.base_pose(), positions, velocities, twist)

    def _spring(self, state: RobotState) -> None:
        """Applies the joint efforts of IMPEDANCE_CONTROL.

        The efforts are the sum of spring and damper efforts and of efforts that compensate gravity, Coriolis and
        centrifugal forces.
        """
        motors, model = self.motors, self.robot_model
        wanted = [
            motors.impedance_setpoints.get(joint.index, (motors.targets[joint.index], 0.0)) for joint in model.joints
        ]
        motors.impedance_setpoints.clear()
        if not wanted:
            return
        positions, velocities = np.array(wanted).T
        mass, velocity = model.mass_matrix(state.position), np.array(state.velocity)
        springs = self._springs.efforts(mass, positions - state.position, velocity, velocities)
        efforts = springs + model.bias(state.base, state.position, state.velocity)
        indices = (joint.index for joint in model.joints)
        driven = self.controllers.driven
        motors.apply_efforts({index: effort for index, effort in zip(indices, efforts.tolist()) if index not in driven})

    def _controlled_robot(self) -> ControlledRobot:
        links = {joint.link: joint.index for joint in self.joints}
        none = np.zeros(0, np.int64)
        dt_s: float = self.pb.getPhysicsEngineParameters()["fixedTimeStep"]
        return ControlledRobot(self.name, self.link_pose, self.robot_model, links, none, dt_s)

    def _controller_inputs(self) -> dict[str, Input]:
        """Returns the inputs of the controllers, indexed by `CONTROLLER/INPUT`."""
        return {
            f"{name}/{key}": Input(
                partial(self._check_controller_input, name, key),
                partial(self.controllers.set_target, name, key),
                ros_topic=topic,
                owner=f"{self.name}/{name}",
            )
            for name in self.controllers.names
            for key, topic in self.controllers.of(name).inputs.items()
        }

    def _check_controller_input(self, name: str, key: str, value: Any) -> Any:
        return self.controllers.of(name).check(key, value)

    def _warn_mimic(self, names: Sequence[str]) -> None:
        """If targets name a mimic joint, logs once that such targets have no effect."""
        for index, coupling in self.model.couplings.items():
            joint, leader = self.model.joints[index].name, self.model.joints[coupling.leader].name
            if joint in names:
                log.info("%s: targets of '%s' have no effect: it follows '%s'", self.name, joint, leader)
                self._warned_mimic = True

    def _gains(self) -> dict[int, dict[str, float]]:
        """Returns gains as keyword arguments of PyBullet, indexed by joint index; expects a checked configuration."""
        gains: dict[int, dict[str, float]] = {}
        for key, given in self._configured_gains().items():
            argument = key.removesuffix("s")
            if isinstance(given, Mapping):
                by_index = {self.model[name].index: gain for name, gain in given.items()}
            else:
                by_index = {joint.index: given[i % len(given)] for i, joint in enumerate(self.model.moving)}
            for index, gain in by_index.items():
                gains.setdefault(index, {})[argument] = gain
        return gains

    def _configured_gains(self) -> dict[str, tuple[float, ...] | dict[str, float]]:
        motors = self.config.setJointMotorControlArray
        given = {key: getattr(motors, key) for key in ("positionGains", "velocityGains")}
        return {key: gains for key, gains in given.items() if gains is not None}

    def _problems(self) -> list[Problem]:
        driven = [joint.name for joint in self.model.driven]
        moving = [joint.name for joint in self.model.moving]
        problems = super()._problems()
        problems += trajectory_problems(self.name, self.config.joint_trajectory_controller, driven)
        for key, gains in self._configured_gains().items():
            path = f"setJointMotorControlArray.{key}"
            if isinstance(gains, Mapping):
                problems += self._unknown_joints({f"{path}.{name}": name for name in gains})
            elif len(gains) not in (1, len(moving)):
                message = f"expected 1 number or {len(moving)}, one for each of {', '.join(moving)}; got {len(gains)}"
                problems.append(Problem(self.name, path, message))
        problems += controller_problems(self._controlled_robot(), self.config.controllers)
        for key in ("stiffness", "damping_ratio"):
            try:
                self.config.impedance.by_joint(key, self.model.driven)
            except ValueError as error:
                problems.append(Problem(self.name, f"impedance.{key}", str(error).removeprefix(f"{key}: ")))
        return [*problems, *self._force_torque_problems(), *self._model_problems()]

    def _model_problems(self) -> list[Problem]:
        """If the robot has joints with several axes, returns a problem for each key that needs inverse dynamics.

        PyBullet's inverse dynamics does not support such joints.
        """
        others = [joint.name for joint in self.joints if not (joint.is_driven or joint.is_fixed)]
        motors = self.config.setJointMotorControlArray
        needs = {
            "gravity_compensation": self.config.gravity_compensation,
            "controllers": self.config.controllers,
            "setJointMotorControlArray.controlMode": motors is not None and motors.controlMode == IMPEDANCE_CONTROL,
        }
        message = f"works with revolute, prismatic and fixed joints only; there are {', '.join(others)}"
        return [Problem(self.name, key, message) for key, needed in needs.items() if needed and others]

    def _force_torque_problems(self) -> list[Problem]:
        problems = []
        joints = [each.joint for each in self.config.enabled_joint_force_torque_sensors]
        for index, joint in enumerate(joints):
            key = f"enabled_joint_force_torque_sensors[{index}]"
            if joint in joints[:index]:
                problems.append(Problem(self.name, key, f"joint '{joint}' has a sensor already; one joint has one"))
            if not re.fullmatch(r"\w+", joint, re.ASCII):
                message = f"topics are named after joint '{joint}', which may only have letters, digits and '_'"
                problems.append(Problem(self.name, key, message))
            problems += self._unknown_joints({key: joint})
        return problems
