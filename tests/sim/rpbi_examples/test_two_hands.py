"""Two arms behind one guard: targets that cross them bring them no nearer than its margin."""

from __future__ import annotations

import math

import numpy as np
import pytest

from custom_ros_tools.config import load_config
from robot_model.model import RobotModel
from robot_model.urdf.files import write_description
from rpbi.samples import JointStateSample
from rpbi.world import World
from rpbi.world.loading import robots_description
from rpbi_examples.two_hands import APPROACH_S, MirroredHands
from safe_robot.check import CheckContext
from safe_robot.checks.proximity_check import link_distances
from safe_robot.ros.parameters import guard_of

FOLDER = "{rpbi_examples}/configs/basic_example_dual_iiwa"
FILE = f"{FOLDER}/config.yaml"
ARMS = "left", "right"
MARGIN_M, PERIOD_S = 0.05, 0.02
CROSSING_M = 0.3
"""Distance of the circles' centres with which the targets cross the arms [m]."""


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return RobotModel(write_description(robots_description(FILE, ARMS).replace("file://", "")))


def least_distance(robot: RobotModel, is_guarded: bool) -> tuple[float, int]:
    """Sends targets that cross the arms; returns the least measured distance [m], and how many were not safe."""
    world = World.from_file(FILE)
    guard, _ = guard_of({**load_config(f"{FOLDER}/guard.yaml"), "period_s": 0.9 * PERIOD_S}, robot.urdf_path, "guard")
    guard.start()
    distances = link_distances(robot)
    pairs = [(a, b) for a in distances.links for b in distances.links if a < b and a[:4] != b[:4]]
    measured: dict[str, float] = {}
    least, unsafe = math.inf, 0

    def run() -> None:
        for sample in [each for _ in range(round(PERIOD_S / world.clock.dt_s)) for each in world.step()]:
            if isinstance(sample, JointStateSample):
                measured.update({f"{sample.name}_{name}": q for name, q in zip(sample.joint_names, sample.position)})

    run()
    hands = MirroredHands(robot.urdf_path, ARMS, {name: measured[name] for name in robot.joint_names}, CROSSING_M)
    for k in range(round((APPROACH_S + 6.0) / PERIOD_S)):
        command = hands.at(k * PERIOD_S)
        if is_guarded:
            decision = guard.decide(command, CheckContext(measured=measured))
            assert decision.command is not None, decision
            command, unsafe = decision.command, unsafe + (decision.violation is not None)
        target = dict(zip(robot.joint_names, command))
        for arm in ARMS:
            world.put(f"{arm}/target", {n[len(arm) + 1 :]: q for n, q in target.items() if n.startswith(arm)})
        run()
        distances.place(np.array([measured[name] for name in robot.joint_names]))
        least = min(least, *(distances.distance(pair, 0.5) for pair in pairs))
    world.close()
    return least, unsafe


def test_targets_that_cross_the_arms_keep_them_a_margin_apart(robot):
    least, unsafe = least_distance(robot, is_guarded=True)
    assert MARGIN_M - 0.002 < least < 2.0 * MARGIN_M and unsafe > 50


def test_without_the_guard_they_touch(robot):
    least, _ = least_distance(robot, is_guarded=False)
    assert least < 0.002
