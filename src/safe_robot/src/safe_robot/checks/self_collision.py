"""Distances between the links of the robot."""

from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import Field

from custom_ros_tools.errors import ConfigError, Problem, hint
from custom_ros_tools.schema import NonNegativeMetres, Text
from rpbi.urdf.document import disabled_collisions
from safe_robot.check import Check, CheckConfig, Situation, Violation
from safe_robot.distances import LinkDistances, Pair, named
from safe_robot.limits import JointLimits
from safe_robot.motion import Motion
from safe_robot.robot import GuardedRobot

LEAST_SPACING_M = 0.01
"""The braking is tried no more densely than this [m], however small the margin is."""
ROUNDING_M = 1e-9
"""Distances that differ by less are equal [m]."""
FAR_M = 0.3
"""Distances are not looked at beyond this [m]."""


class SelfCollisionConfig(CheckConfig):
    """How near the links of the robot may come to each other."""

    margin_m: NonNegativeMetres = Field(0.01, description="Least distance between links [m].")
    srdf: Text | None = Field(None, description="A SRDF; pairs for which it disables collisions are left out.")
    pairs_file: Text | None = Field(
        None, description="YAML of the pairs; it is written if it is not there, and read if it is."
    )


class SelfCollision(Check):
    """Links that are not neighbours stay apart, also while the robot brakes.

    Distances are looked at anew only when joints have moved so far since that a pair might be too near. So most
    commands need few of them, and the answers are the same.
    """

    Config = SelfCollisionConfig
    name = "self_collision"
    is_default = True

    def __init__(self, config: Any, robot: GuardedRobot, limits: JointLimits, file: str) -> None:
        super().__init__(config, robot, limits, file)
        self.distances = LinkDistances(robot)
        self.pairs = self._pairs()
        n = len(robot.joint_names)
        self._reach = np.array([self.distances.reach(pair) for pair in self.pairs]).reshape(-1, n)
        self._known_at = np.zeros((len(self.pairs), n))  # where each pair's distance was looked at last
        self._known_m = np.full(len(self.pairs), -np.inf)

    def check(self, motion: Motion, situation: Situation) -> Violation | None:
        """See `Check`."""
        if not np.isfinite(motion.position).all():  # PyBullet would find nothing near it
            return Violation(self.name, "the robot", float("nan"), self.config.margin_m, "m of distance")
        near = self._near(motion)
        if near.any():
            self.distances.place(motion.position[0])
            for i in np.flatnonzero(near).tolist():
                self._known_m[i] = min(self.distances.distance(self.pairs[i], FAR_M), FAR_M)
                self._known_at[i] = motion.position[0]
            near = self._near(motion)
        return self._nearer(motion, np.flatnonzero(near).tolist())

    def _near(self, motion: Motion) -> np.ndarray:
        """Returns which pairs might come too near, by how far they were apart somewhere and how far they move."""
        path = np.abs(np.diff(motion.position, axis=0)).sum(axis=0)
        moved = np.abs(motion.position[0] - self._known_at) + path  # pairs x n
        nearest = self._known_m - (moved * self._reach).sum(axis=1)
        return ~(nearest > self.config.margin_m + ROUNDING_M)

    def _nearer(self, motion: Motion, indices: list[int]) -> Violation | None:
        """Returns the first of some pairs that comes nearer than the margin, and nearer than it was."""
        if not indices:
            return None
        margin_m = self.config.margin_m
        reach = self._reach[indices].max(axis=0)
        for row in motion.sparse_rows(reach, max(2.0 * margin_m, LEAST_SPACING_M)).tolist():
            self.distances.place(motion.with_start[row])
            found = {i: self.distances.distance(self.pairs[i], margin_m) for i in indices}
            for i, distance in found.items():
                if not distance >= margin_m and not distance >= self._at(motion.start.position, i) - ROUNDING_M:
                    unit = "m of distance"
                    return Violation(self.name, named(self.pairs[i]), distance, margin_m, unit, row > 1)
        return None

    def _at(self, q: np.ndarray, i: int) -> float:
        self.distances.place(q)
        return self.distances.distance(self.pairs[i], self.config.margin_m)

    def _pairs(self) -> list[Pair]:
        path = self.config.pairs_file
        if path is not None and Path(path).exists():
            return self._read(path)
        pairs = (
            self.distances.pairs(self.config.margin_m) if self.config.srdf is None else self._all_but(self._disabled())
        )
        if path is not None:
            Path(path).write_text(yaml.safe_dump({"pairs": [list(pair) for pair in pairs]}, default_flow_style=None))
        return pairs

    def _read(self, path: str) -> list[Pair]:
        try:
            pairs = [(str(a), str(b)) for a, b in yaml.safe_load(Path(path).read_text())["pairs"]]
        except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError) as error:
            message = f"expected 'pairs': a list of pairs of links, got {error}"
            raise ConfigError([Problem(path, "", message)]) from None
        self._check_links(path, {link for pair in pairs for link in pair}, self.distances.links)
        return pairs

    def _disabled(self) -> set[frozenset[str]]:
        path = str(self.config.srdf)
        disabled = disabled_collisions(path)
        self._check_links(path, {link for pair in disabled for link in pair}, self.robot.links)
        return disabled

    def _check_links(self, path: str, links: set[str], known: Any) -> None:
        problems = [
            Problem(path, link, f"expected a link of {self.robot.urdf_path}, got '{link}'{hint(link, known)}")
            for link in sorted(links)
            if link not in known
        ]
        if problems:
            raise ConfigError(problems)

    def _all_but(self, disabled: set[frozenset[str]]) -> list[Pair]:
        links = self.distances.links
        every = [(a, b) for i, a in enumerate(links) for b in links[i + 1 :]]
        return [pair for pair in every if frozenset(pair) not in disabled]
