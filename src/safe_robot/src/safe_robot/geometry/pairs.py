"""Which pairs of links may come too near to each other."""

import math
import random

import numpy as np

from safe_robot.robot import GuardedRobot

from .distances import LinkDistances

SAMPLES = 200
"""Random configurations in which pairs are tried that may always be near."""
ALWAYS = 0.95
"""Pairs that are too near in this share of them are left out: they are built so."""


def pairs_that_may_meet(robot: GuardedRobot, distances: LinkDistances, margin_m: float) -> list[tuple[str, str]]:
    """Returns the pairs of links that may come nearer than a margin [m].

    Those that a joint ties, or several fixed ones, are left out, and those that nearly always are nearer than the
    margin, as in a compact wrist. It goes by random configurations, the same every time.
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
        distances.place(np.array([_anywhere(generator, joint.lower, joint.upper) for joint in robot.joints]))
        for pair in apart:
            touching[pair] += distances.distance(pair, margin_m, margin_m) < margin_m
    return [pair for pair in apart if touching[pair] < ALWAYS * SAMPLES]


def _group(robot: GuardedRobot, link: str) -> str:
    """Returns the first of the links that fixed joints tie to a link."""
    for joint in reversed(robot.chain(link)):
        if joint.is_moving:
            return joint.child
        link = joint.parent
    return link


def _anywhere(generator: random.Random, lower: float, upper: float) -> float:
    return generator.uniform(max(lower, -math.pi), min(upper, math.pi))
