"""A whole-body controller: a humanoid stands on both feet and reaches for a target with a hand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import ListOf, NonNegative, Text, Unit, optional
from robot_model.asset_files import ExistingFile
from robot_model.geometry import Pose
from rpbi.control.controllers.cartesian_impedance import PoseTarget
from rpbi.control.controllers.controller import Array, ControlledRobot, Controller, ControllerConfig, RobotState
from rpbi.engine.inputs import check_pose
from rpbi_examples.scenes.sensing import BaseEstimate

from .dynamics import FREE, FloatingRobot, turn_between
from .program import WholeBodyProgram, wrench_cone
from .tasks import AccelerationTask, Approach, Gain, capture, pull, spring

LINEAR, ANGULAR, UP = slice(0, 3), slice(3, 6), slice(2, 3)
CAPTURE_WEIGHT = 100.0
"""Weight of the capture point's task. It is the largest weight, since balance matters most."""
HEIGHT, UPRIGHT, POSTURE = Gain(50.0, 20.0), Gain(60.0, 5.0), Gain(30.0, 0.02)
"""Gains for the height of the centre of mass, the torso's orientation, and the posture. The posture has a low weight,
since it only resolves redundancy.
"""
HAND_WEIGHT, HAND_TURN_WEIGHT = 20.0, 0.5
"""Weights of the tasks for the hand's position and orientation."""


class BalanceConfig(ControllerConfig):
    """Configuration keys of the controller `Balance`."""

    urdf_filename: ExistingFile = Field(description="URDF file of the robot; `{package}/path` is accepted.")
    hand: Text = Field(description="Link that is moved to the target.")
    point: Annotated[tuple[float, float, float], Field(strict=False), Unit("m")] = Field(
        (0.0, 0.0, 0.0), description="Point of the link `hand` that is moved to the target, in the link's frame."
    )
    torso: Text = Field(description="Link that is kept upright.")
    soles: ListOf[Text] = Field(
        min_length=1, description="Links of the feet, with frames in the middle of the soles: x forward, z up."
    )
    half_length: Annotated[NonNegative, Unit("m")] = Field(0.09, description="Half of the usable length of a sole.")
    half_width: Annotated[NonNegative, Unit("m")] = Field(0.055, description="Half of the usable width of a sole.")
    friction: NonNegative = Field(0.5, description="Coefficient of friction that the controller assumes at the soles.")
    period_ticks: int = Field(
        2, ge=1, description="Number of ticks between two solutions; joint efforts are constant in between."
    )
    capture_gain: NonNegative = Field(
        3.0, description="Ratio of the centre of pressure's lead to the capture point's error."
    )
    hand_stiffness: Annotated[NonNegative, Unit("1/s^2")] = Field(
        150.0, description="Stiffness of the hand's task, divided by mass."
    )
    noise_seed: Annotated[int, Field(ge=0)] | None = optional(
        "Seed of the noise of the measured base pose, which is also delayed. By default, the controller uses the "
        "true pose."
    )
    hand_speed: Annotated[NonNegative, Unit("m/s")] = Field(0.5, description="Largest speed of the hand.")


class Balance(Controller):
    """Makes a humanoid stand on both feet and move a hand to a target.

    Every `period_ticks` ticks, a quadratic program computes joint efforts. The efforts bring the capture point over the
    midpoint between the feet, and the hand to its target. The efforts also keep the torso upright, and hold the initial
    posture and the initial height of the centre of mass. Constraints prevent the feet from sliding and tipping.

    The input `target` is the desired pose, in the world, of the point `point` on the link `hand`. Until the first
    target arrives, the arm keeps its posture.
    """

    Config = BalanceConfig
    inputs = {"target": "rpbi.ros.inputs:POSE_TARGET"}

    def __init__(self, arm: ControlledRobot, config: Any) -> None:
        super().__init__(arm, config)
        self._robot = robot = FloatingRobot(config.urdf_filename, [arm.model.joints[i].name for i in arm.chosen])
        self._hand, self._torso = robot.frame(config.hand, config.point), robot.frame(config.torso)
        self._soles = [robot.frame(sole) for sole in config.soles]
        cone = wrench_cone(config.half_length, config.half_width, config.friction)
        self._program = WholeBodyProgram(robot, cone, len(self._soles))

    def check(self, key: str, value: PoseTarget | Pose | Mapping[str, Any]) -> Pose:
        """Checks that all numbers of a target's pose are finite, and returns the pose."""
        return check_pose(value.pose if isinstance(value, PoseTarget) else value)

    def start(self, state: RobotState, tick: int) -> None:
        """Stores the present joint positions, yaw of the first sole, and height of the centre of mass as goals."""
        seed, period_s = self.config.noise_seed, self.config.period_ticks * self.arm.dt_s
        self._estimate = None if seed is None else BaseEstimate(state.base, period_s, seed)
        self._robot.update(state)
        self._posture = self._robot.positions.copy()
        self._height = self._robot.centre[2]
        self._upright = _yaw_only(self._robot.placement(self._soles[0]).rotation)
        self._approach: Approach | None = None
        self._efforts = np.zeros(len(self._posture))
        self._ticks = 0
        self._unsolved = 0
        self._errors: dict[str, float] = {}

    def compute(self, state: RobotState, targets: Mapping[str, Any], tick: int) -> Array:
        """Returns the efforts of all joints [N m]. The efforts change only every `period_ticks` ticks."""
        if self._ticks % self.config.period_ticks == 0:
            if self._estimate is not None:
                position, quat_xyzw = self._estimate.update(state.base, *state.base_twist)
                state = state._replace(base=state.base._replace(position=position, quat_xyzw=quat_xyzw))
            self._robot.update(state)
            self._solve(targets.get("target"))
        self._ticks += 1
        return self._efforts

    def report(self) -> Mapping[str, float]:
        """Returns the horizontal distance of the centre of mass from the midpoint between the feet [m], the distance of
        the hand from its target [m], and the number of times that the quadratic program had no solution.
        """
        return {**self._errors, "unsolved": float(self._unsolved)}

    def _solve(self, target: Pose | None) -> None:
        robot, config = self._robot, self.config
        centre = robot.motion_of_centre()
        middle = np.mean([robot.placement(sole).translation for sole in self._soles], axis=0)
        turn = turn_between(robot.placement(self._torso).rotation, self._upright)
        height = self._height - middle[2]
        tasks = [
            capture(centre, robot.centre, middle[:2], height, config.capture_gain, CAPTURE_WEIGHT),
            spring(centre, UP, self._height - robot.centre[UP], HEIGHT),
            spring(robot.motion(self._torso), ANGULAR, turn, UPRIGHT),
        ]
        self._errors = {"centre": float(np.linalg.norm(robot.centre[:2] - middle[:2]))}
        if target is not None:
            tasks += self._hand_tasks(target)
        posture = pull(self._posture - robot.positions, -robot.velocities[FREE:], POSTURE)
        feet = [robot.motion(sole, own_axes=True) for sole in self._soles]
        found = self._program.solve(tasks, posture, POSTURE.weight, feet)
        if found is None:
            self._unsolved += 1
        else:
            self._efforts = robot.in_given_order(found)

    def _hand_tasks(self, target: Pose) -> list[AccelerationTask]:
        placement = self._robot.placement(self._hand)
        if self._approach is None:
            period_s = self.config.period_ticks * self.arm.dt_s
            self._approach = Approach(placement.translation, placement.rotation, period_s, self.config.hand_speed)
        way = self._approach
        way.advance(target, placement.translation, placement.rotation)
        self._errors["hand"] = float(np.linalg.norm(target.position - placement.translation))
        motion, stiffness = self._robot.motion(self._hand), self.config.hand_stiffness
        turn = turn_between(placement.rotation, way.turn)
        return [
            spring(motion, LINEAR, way.position - placement.translation, Gain(stiffness, HAND_WEIGHT), way.velocity),
            spring(motion, ANGULAR, turn, Gain(stiffness, HAND_TURN_WEIGHT)),
        ]


def _yaw_only(rotation: Array) -> Array:
    """Returns the rotation about the vertical that has the yaw of `rotation`. Both matrices have the shape (3, 3)."""
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array(((cos, -sin, 0.0), (sin, cos, 0.0), (0.0, 0.0, 1.0)))
