"""Check of the distances between the links of the robot."""

import math
import os
import random
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import Field

from custom_ros_tools.errors import ConfigError, Problem, hint
from custom_ros_tools.schema import NonNegativeMetres, Text
from robot_model.collision.distances import Geometry, LinkDistances, Pair
from robot_model.model import RobotModel
from robot_model.urdf.document import disabled_collisions
from safe_robot.check import CheckConfig, CheckContext, Violation
from safe_robot.limits import MotionLimits
from safe_robot.motion import CommandedMotion

from .proximity import Proximity
from .proximity_check import GEOMETRY, ProximityCheck, link_distances

SAMPLES = 200
"""Number of random configurations that are used to find pairs that are always near."""
NEARLY_ALWAYS = 0.95
"""A pair that is too near in at least this share of configurations is left out: it is near by construction."""


class SelfCollisionConfig(CheckConfig):
    """Minimum distance between the links of the robot."""

    margin_m: NonNegativeMetres = Field(0.01, description="Least distance between two links [m].")
    geometry: Geometry = Field("hulls", description=GEOMETRY)
    srdf: Text | None = Field(
        None, description="SRDF file with pairs of links whose collisions are disabled; these pairs are not checked."
    )
    pairs_file: Text | None = Field(
        None,
        description="YAML file of the checked pairs of links. An existing file is read, otherwise the file is written.",
    )


class SelfCollision(ProximityCheck):
    """Checks that links of the robot keep their distance from each other, also while the robot brakes."""

    Config = SelfCollisionConfig
    name = "self_collision"
    is_default = True

    def __init__(self, config: Any, robot: RobotModel, limits: MotionLimits, file: str) -> None:
        super().__init__(config, robot, limits, file)
        self.distances = link_distances(robot, config.geometry)
        self.pairs = self._pairs()
        self.proximity = Proximity(self.distances, self.pairs, config.margin_m)

    def check(self, motion: CommandedMotion, context: CheckContext) -> Violation | None:
        """See `Check`."""
        return self.undefined(motion) or self.too_near(motion)

    def subject(self, pair: Pair) -> str:
        """See `ProximityCheck`."""
        return "links '{}' and '{}'".format(*pair)

    def _pairs(self) -> list[tuple[str, str]]:
        path = self.config.pairs_file
        if path is not None and os.path.exists(path):
            return self._read(path)
        if self.config.srdf is None:
            pairs = pairs_that_may_meet(self.robot, self.distances, self.config.margin_m)
        else:
            pairs = self._all_but(self._disabled())
        if path is not None:
            self._write(path, pairs)
        return pairs

    def _write(self, path: str, pairs: list[tuple[str, str]]) -> None:
        try:
            Path(path).write_text(yaml.safe_dump({"pairs": [list(pair) for pair in pairs]}, default_flow_style=None))
        except (OSError, ValueError) as error:
            message = f"expected a file that can be written, got {error}"
            raise ConfigError([Problem(self.file, "checks.self_collision.pairs_file", message)]) from None

    def _read(self, path: str) -> list[tuple[str, str]]:
        try:
            pairs = [(str(a), str(b)) for a, b in yaml.safe_load(Path(path).read_text())["pairs"]]
        except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError) as error:
            message = f"expected 'pairs': a list of pairs of links, got {error}"
            raise ConfigError([Problem(path, "", message)]) from None
        self._check_links(path, {link for pair in pairs for link in pair}, self.distances.links)
        if same := [first for first, second in pairs if first == second]:
            raise ConfigError([Problem(path, "pairs", f"expected two links, got '{same[0]}' twice")])
        return pairs

    def _disabled(self) -> set[frozenset[str]]:
        path = str(self.config.srdf)
        disabled = disabled_collisions(path)
        if not disabled:
            message = f"expected pairs of links of {self.robot.urdf_path} as disable_collisions, got none"
            raise ConfigError([Problem(path, "", message)])
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

    def _all_but(self, disabled: set[frozenset[str]]) -> list[tuple[str, str]]:
        links = self.distances.links
        every = [(a, b) for i, a in enumerate(links) for b in links[i + 1 :]]
        return [pair for pair in every if frozenset(pair) not in disabled]


def pairs_that_may_meet(robot: RobotModel, distances: LinkDistances, margin_m: float) -> list[tuple[str, str]]:
    """Returns the pairs of links that may come nearer than a margin [m].

    Pairs that are connected by one moving joint, or by fixed joints only, are left out. Pairs that are nearer than the
    margin in nearly all of several random configurations, as in a compact wrist, are left out, too. The random
    configurations have a fixed seed.
    """
    groups = {link: _group(robot, link) for link in distances.links}
    parents = {joint.child: _group(robot, joint.parent) for joint in robot.document.joints.values() if joint.is_moving}
    apart = [
        (a, b)
        for i, a in enumerate(distances.links)
        for b in distances.links[i + 1 :]
        if groups[a] != groups[b] and parents.get(groups[a]) != groups[b] and parents.get(groups[b]) != groups[a]
    ]
    touching = dict.fromkeys(apart, 0)
    generator = random.Random(0)
    for _ in range(SAMPLES):
        distances.place(np.array([_random_position(generator, joint.lower, joint.upper) for joint in robot.joints]))
        for pair in apart:
            touching[pair] += distances.distance(pair, margin_m, margin_m) < margin_m
    return [pair for pair in apart if touching[pair] < NEARLY_ALWAYS * SAMPLES]


def _group(robot: RobotModel, link: str) -> str:
    """Follows fixed joints from a link towards the root, and returns the last link that is reached."""
    for joint in reversed(robot.chain(link)):
        if joint.is_moving:
            return joint.child
        link = joint.parent
    return link


def _random_position(generator: random.Random, lower: float, upper: float) -> float:
    return generator.uniform(max(lower, -math.pi), min(upper, math.pi))
