"""Checks the rest of a running motion against a scene whose bodies have moved since the motion was planned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from custom_ros_tools.transforms import Array

from .collision import CollisionModel
from .group import Group
from .proofs import JointMotion
from .scene import PlanningScene

SHARE = 0.5
"""Share of the scene's paddings that must be left, so that small motions of bodies at rest do not end a motion."""


class RestOfMotion:
    """The part of a motion after a time, from time 0 on; see `JointMotion`.

    Args:
        motion: The whole motion.
        from_s: Time at which the part begins [s].
    """

    def __init__(self, motion: JointMotion, from_s: float) -> None:
        self._motion, self._from_s = motion, from_s
        self.duration = motion.duration - from_s

    def at(self, times: Array) -> Array:
        """See `JointMotion`."""
        return self._motion.at(times + self._from_s)

    def variation(self, start: Array, end: Array) -> Array:
        """See `JointMotion`."""
        return self._motion.variation(start + self._from_s, end + self._from_s)


class PathCheck:
    """Finds contacts on the rest of a motion. The collision model is kept as long as the scene has the same bodies.

    Args:
        scene: The scene.
        robot: Name of the robot.
        joint_names: Names of the n joints that the motion moves.

    Attributes:
        scene: The scene, which may be replaced by one with other bodies.
    """

    def __init__(self, scene: PlanningScene, robot: str, joint_names: Sequence[str]) -> None:
        self.scene = scene
        self._robot, self._joint_names = robot, tuple(joint_names)
        self._model: CollisionModel | None = None
        self._version = -1
        """Version of the scene for which the model was made."""

    def first_meeting(self, motion: JointMotion, from_s: float = 0.0) -> str:
        """Returns the shapes that come too near to each other after a time [s], as text; empty if there are none."""
        if self._model is None or self._model.scene is not self.scene or self._version != self.scene.version:
            self._model = CollisionModel(self.scene, Group(self.scene, [self._robot], self._joint_names))
            self._model.set_paddings(SHARE * self._model.padding)
            self._version = self.scene.version
        else:
            self._model.update()
        rest = RestOfMotion(motion, min(from_s, motion.duration))
        time_s = self._model.first_unproven(rest)
        if time_s is None:
            return ""
        meetings = self._model.meetings(rest.at(np.array((time_s,)))[0])
        return str(meetings[0]) if meetings else "the motion is not proven to be free any more"
