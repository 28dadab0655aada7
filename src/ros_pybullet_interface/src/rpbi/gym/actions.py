"""Parts of actions: numbers in [-1, 1] that move joints or a link within limits."""

from __future__ import annotations

from collections.abc import Sequence
from operator import sub
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from robot_model.geometry import normalized, quaternion_of, quaternion_product, rotation_between
from robot_model.linear_algebra import solve
from rpbi.control.joint_command import JointCommand
from rpbi.geometry import Pose
from rpbi.world import World

from .parts import link_index, robot_of

Values = npt.NDArray[np.float64]

DAMPING = 1e-4 * np.eye(6)
"""Damping of the Jacobian's inverse [m^2]: near singular configurations, the hand moves more slowly than commanded."""


class ActionPart(Protocol):
    """A part of an action: consecutive values in the action array.

    Attributes:
        size: Number of values that belong to the part.
    """

    size: int

    def reset(self) -> None:
        """Prepares an episode that starts from the present state of the world, which was just reset."""

    def apply(self, values: Values) -> None:
        """Applies the values of the part, in [-1, 1], shape (size,)."""


class JointAction:
    """Moves joint targets of a robot.

    Each value, from -1 to 1, is multiplied by the maximum change per action to give the change of a joint's target.

    Args:
        joints: Names of the joints that move; all joints with motors if empty.
        speed: Maximum speed of each joint, as a fraction of the joint's velocity limit in the URDF.
        period_s: Duration of an action [s].
    """

    def __init__(self, world: World, robot: str, joints: Sequence[str], speed: float, period_s: float) -> None:
        self._world, self._robot, self._slot = world, robot, f"{robot}/target"
        driven = robot_of(world, robot).model.driven
        chosen = [robot_of(world, robot).model[name] for name in joints] or driven
        self._names = [joint.name for joint in chosen]
        self._indices = [joint.index for joint in chosen]
        self._lower, self._upper = np.array([(joint.lower, joint.upper) for joint in chosen]).T
        self._steps = np.array([min(speed * joint.max_velocity, 1e3) * period_s for joint in chosen])
        self._targets = np.zeros(len(chosen))
        self.size = len(chosen)

    def reset(self) -> None:
        """Sets the targets to the present joint positions."""
        positions = robot_of(self._world, self._robot).joint_positions()
        self._targets = np.array([positions[index] for index in self._indices])

    def apply(self, values: Values) -> None:
        """Moves the targets within the joint limits, and sends the targets to the robot."""
        self._targets = np.minimum(np.maximum(self._targets + values * self._steps, self._lower), self._upper)
        self._world.put(self._slot, JointCommand(self._names, position=self._targets.tolist()))


class PoseAction:
    """Moves the target pose of a controller that controls the pose of a point on a link.

    The first three values are translations along the world's x, y and z axes. The last three values are rotations about
    these axes. The target starts at the pose of the controlled point. While the controller is inactive, actions have no
    effect.

    Args:
        controller: Name, as `ROBOT/CONTROLLER`. The controller's configuration must contain `point`, the controlled
            point in the link's frame. The controller's input `target` must accept a pose.
        link: Name of the controlled link.
        low: Lower corner [m] of the target's box-shaped workspace, in the world frame.
        high: Upper corner [m] of the workspace, in the world frame.
        step: Maximum translation [m] per action along each axis.
        turn: Maximum rotation [rad] per action about each axis.
    """

    size = 6

    def __init__(
        self,
        world: World,
        controller: str,
        link: str,
        low: Sequence[float],
        high: Sequence[float],
        step: float,
        turn: float,
    ) -> None:
        self._world, self._slot = world, f"{controller}/target"
        self._robot, _, self._controller = controller.partition("/")
        robot = robot_of(world, self._robot)
        config: Any = robot.controllers.config(self._controller)
        self._link, self._point = link_index(robot, link), Pose(config.point)
        self._low, self._high, self._step, self._turn = low, high, step, turn
        self.goal = Pose()
        """Target pose of the controlled point, in the world."""

    def reset(self) -> None:
        """Sets the target to the present pose of the controlled point."""
        self.goal = robot_of(self._world, self._robot).link_pose(self._link) @ self._point

    def apply(self, values: Values) -> None:
        """Moves the target within the workspace; if the controller is inactive, resets the target instead."""
        if not robot_of(self._world, self._robot).controllers.is_active(self._controller):
            self.reset()
            return
        x, y, z = np.clip(self.goal.position + self._step * values[:3], self._low, self._high).tolist()
        about_x, about_y, about_z = (self._turn * values[3:]).tolist()
        turned = quaternion_product(quaternion_of((about_x, about_y, about_z)), self.goal.quat_xyzw)
        self.goal = Pose((x, y, z), normalized(turned))
        self._world.put(self._slot, self.goal)


class HandAction:
    """Moves a robot's link along axes of the world, and keeps the link's orientation.

    Args:
        link: Name of the link, whose URDF frame moves.
        axes: Axes of the world along which the link moves, such as `xy`. Along the remaining axes, the link keeps its
            start position.
        low: Lower corner [m] of the target's box-shaped workspace, in the world frame.
        high: Upper corner [m] of the workspace, in the world frame.
        step: Maximum translation [m] per action along each axis.
    """

    def __init__(
        self,
        world: World,
        robot: str,
        link: str,
        axes: str,
        low: Sequence[float],
        high: Sequence[float],
        step: float,
    ) -> None:
        self._world, self._robot, self._slot = world, robot, f"{robot}/target"
        self._link = link_index(robot_of(world, robot), link)
        self._axes = ["xyz".index(axis) for axis in axes]
        self._low, self._high, self._step = tuple(low), tuple(high), step
        self._start = Pose()
        self._moves = self._columns()
        driven = robot_of(world, robot).model.driven
        self._names = [joint.name for joint, moves in zip(driven, self._moves) if moves]
        self._lower, self._upper = np.array([(joint.lower, joint.upper) for joint in driven]).T
        self.goal = [0.0, 0.0, 0.0]
        """Target position of the link, in the world [m]."""
        self.size = len(axes)

    def reset(self) -> None:
        """Sets the start pose to the link's present pose, and the target position to the link's present position."""
        self._start = robot_of(self._world, self._robot).link_pose(self._link)
        self.goal = list(self._start.position)

    def apply(self, values: Values) -> None:
        """Moves the link's target within the workspace, and sends joint targets to the robot.

        The joint targets are computed from the link's target with a damped inverse of the Jacobian.
        """
        for axis, value in zip(self._axes, values.tolist()):
            self.goal[axis] = min(max(self.goal[axis] + self._step * value, self._low[axis]), self._high[axis])
        robot = robot_of(self._world, self._robot)
        pose = robot.link_pose(self._link)
        turn = rotation_between(pose.quat_xyzw, self._start.quat_xyzw)
        error = np.array([*map(sub, self.goal, pose.position), *turn])
        positions = [state[0] for state in robot.drive.measured().values()]
        jacobian = robot.robot_model.jacobian(robot.base_pose(), positions, self._link)
        change = jacobian.T @ solve(jacobian @ jacobian.T + DAMPING, error)
        targets = np.minimum(np.maximum(positions + change, self._lower), self._upper)[self._moves]
        self._world.put(self._slot, JointCommand(self._names, position=targets.tolist()))

    def _columns(self) -> npt.NDArray[np.bool_]:
        """Returns, for each driven joint, whether it moves the link."""
        robot = robot_of(self._world, self._robot)
        positions = [state[0] for state in robot.drive.measured().values()]
        moves: npt.NDArray[np.bool_] = robot.robot_model.jacobian(robot.base_pose(), positions, self._link).any(axis=0)
        return moves


class GripperAction:
    """Opens or closes the fingers of a gripper.

    The value, from -1 (close) to 1 (open), is multiplied by `step` to give the change of the target.

    Args:
        joints: Finger joints, which all get the same target.
        step: Maximum change [m or rad] of the target per action.
    """

    size = 1

    def __init__(self, world: World, robot: str, joints: Sequence[str], step: float) -> None:
        self._world, self._robot, self._slot = world, robot, f"{robot}/target"
        self._names, self._step = tuple(joints), step
        joint = robot_of(world, robot).model[joints[0]]
        self._index, self._lower, self._upper = joint.index, joint.lower, joint.upper
        self._target = 0.0

    def reset(self) -> None:
        """Sets the target to the present position of the first finger joint."""
        self._target = robot_of(self._world, self._robot).joint_positions()[self._index]

    def apply(self, values: Values) -> None:
        """Moves the target within the limits of the first finger joint, and sends the target to all finger joints."""
        self._target = min(max(self._target + self._step * float(values[0]), self._lower), self._upper)
        self._world.put(self._slot, JointCommand(self._names, position=(self._target,) * len(self._names)))
