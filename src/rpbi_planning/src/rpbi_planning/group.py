"""The joints that a plan moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from custom_ros_tools.errors import UnknownNameError

from .scene import PlanningScene

Array = np.ndarray


class Group:
    """The joints that a plan moves, of one or several robots.

    Args:
        scene: The scene.
        robots: Names of the robots.
        joints: Names of the joints that move; None for all driven joints. With several robots, names are `robot/joint`.

    Attributes:
        robots: The robots.
        joint_names: Names of the n joints.
        lower, upper: Position limits [rad or m].
        velocity, acceleration, jerk: Limits of the n joints.

    Raises:
        ValueError: If no joint is left, or a joint is unknown.
    """

    def __init__(self, scene: PlanningScene, robots: Sequence[str], joints: Sequence[str] | None = None) -> None:
        self.robots = [scene.robot(name) for name in robots]
        many = len(self.robots) > 1
        names = [
            (f"{robot.name}/{joint}" if many else joint, r, i)
            for r, robot in enumerate(self.robots)
            for i, joint in enumerate(robot.model.joint_names)
        ]
        known = [name for name, _, _ in names]
        if joints is not None:
            for joint in joints:
                if joint not in known:
                    raise UnknownNameError("joint", joint, known)
            names = [each for each in names if each[0] in set(joints)]
        if not names:
            raise ValueError("group: expected at least one joint, got none")
        self.joint_names = tuple(name for name, _, _ in names)
        self.columns = [[i for _, owner, i in names if owner == r] for r in range(len(self.robots))]
        self.slices = [[at for at, (_, owner, _) in enumerate(names) if owner == r] for r in range(len(self.robots))]
        limits = [robot.limits for robot in self.robots]
        self.lower, self.upper, self.velocity, self.acceleration, self.jerk = (
            np.concatenate([getattr(each, key)[columns] for each, columns in zip(limits, self.columns)])
            for key in ("lower", "upper", "velocity", "acceleration", "jerk")
        )

    def full(self, q: Array, robot: int) -> Array:
        """Returns all driven positions of one of the robots in k configurations of the group, k x m."""
        positions = np.repeat(self.robots[robot].positions[None], len(q), axis=0)
        positions[:, self.columns[robot]] = q[:, self.slices[robot]]
        return positions

    def of(self, positions: Sequence[Array]) -> Array:
        """Returns the positions of the group from all driven positions of each robot, shape (n,)."""
        q = np.empty(len(self.joint_names))
        for at, columns, each in zip(self.slices, self.columns, positions):
            q[at] = each[columns]
        return q

    @property
    def motion_limits(self) -> tuple[Array, Array, Array]:
        """Limits of velocity, acceleration and jerk, shape (n,) each."""
        return self.velocity, self.acceleration, self.jerk

    @property
    def present(self) -> Array:
        """The present positions of the group, shape (n,)."""
        return self.of([robot.positions for robot in self.robots])
