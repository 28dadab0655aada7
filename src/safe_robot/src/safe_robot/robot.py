"""The robot that is guarded: bounds of the motion of its links by its joints."""

import math
from collections.abc import Sequence

import numpy as np

from custom_ros_tools.errors import ConfigError, Problem
from robot_model.model import RobotModel

MAX_OUTSIDE = 0.1
"""Largest distance outside its limits at which a telescopic joint may start [rad or m]; further out it is refused."""


class GuardedRobot(RobotModel):
    """A robot whose driven joints are the guarded ones, in the order in which they are checked.

    Other joints are at 0, or at the limit nearest to 0; mimic joints follow.

    Attributes:
        telescopic: Names of the guarded prismatic joints that move links which other joints turn.
        still: Names of the joints that do not move; joint states may include them.
    """

    def __init__(self, urdf_path: str, joint_names: Sequence[str] = ()) -> None:
        super().__init__(urdf_path, joint_names)
        self.still = frozenset(name for name, joint in self.all_joints.items() if joint.type == "fixed")
        moving = [joint.name for joint in self.all_joints.values() if joint.is_moving]
        factors, offsets = self.map_to(moving)
        self._factors = dict(zip(moving, np.abs(factors)))
        """Largest motion of each joint that moves for 1 rad or m of each guarded one."""
        self._offsets = dict(zip(moving, np.abs(offsets).tolist()))
        self.telescopic = tuple(dict.fromkeys(name for link in self.links for name in self._telescopic_to(link)))

    def reach(self, link: str, radius_m: float, other: str | None = None) -> np.ndarray:
        """Returns the largest distances that n joints move any point of a link in another link, for 1 rad or m each.

        Args:
            link: The link.
            radius_m: Distance of the farthest point of its shape from its origin [m].
            other: The other link, by default the root; joints above both have no effect.

        Raises:
            ConfigError: If a distance has no limit.
        """
        still = {joint.name for joint in self.chain(self.root if other is None else other)}
        reach, beyond = np.zeros(len(self.joint_names)), radius_m
        for joint in reversed(self.chain(link)):
            if joint.name in still:
                break
            if joint.is_moving:
                moved = self._factors[joint.name].nonzero()  # the others are not needed, even if they have no limits
                reach[moved] += self._factors[joint.name][moved] * (beyond if joint.is_revolute else 1.0)
            beyond += math.hypot(*joint.xyz)
            if joint.is_moving and not joint.is_revolute:
                beyond += self._travel(joint.name)
        if not np.isfinite(reach).all():
            name = self.joint_names[int(np.argmin(np.isfinite(reach)))]
            message = f"expected limits for prismatic joints between joint '{name}' and link '{link}'"
            raise ConfigError([Problem(self.urdf_path, "", message)])
        return reach

    def _travel(self, name: str) -> float:
        """Returns the largest distance of a joint from its position 0 [rad or m]."""
        farthest = (max(abs(joint.lower), abs(joint.upper)) + MAX_OUTSIDE for joint in self.joints)
        travels = (factor * most for factor, most in zip(self._factors[name].tolist(), farthest) if factor)
        return self._offsets[name] + sum(travels)

    def _telescopic_to(self, link: str) -> list[str]:
        """Returns the names of the guarded joints that slide a link which other joints turn."""
        turned, telescopic = False, []
        for joint in self.chain(link):
            if not joint.is_moving or not self._factors[joint.name].any():
                continue
            if joint.is_revolute:
                turned = True
            elif turned:
                telescopic.append(self.joint_names[int(self._factors[joint.name].argmax())])
        return telescopic
