"""The motion of the example robots."""

import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pybullet_data
import pytest
import yaml

from robot_model.asset_files import find_file
from robot_model.model import RobotModel
from rpbi_examples.motions import SWING_PERIOD_S, TO_MIDDLE_S, Swing
from safe_robot.checks.proximity_check import link_distances
from safe_robot.checks.self_collision import pairs_that_may_meet

EXAMPLES = Path(__file__).parents[3] / "src/rpbi_examples"
ARM = [f"panda_joint{i}" for i in range(1, 8)]
MARGIN_M = 0.01
"""That of the guard, by default."""

START = (0.3, -1.2, 0.0)
LOWER = (-2.0, -0.5, -math.inf)
UPPER = (2.0, 2.0, math.inf)


@pytest.fixture
def swing():
    return Swing(START, LOWER, UPPER)


def test_it_starts_where_the_robot_is_and_comes_to_zero(swing):
    assert swing.at(0.0) == START
    assert swing.at(TO_MIDDLE_S) == (0.0, 0.0, 0.0)


def test_one_joint_moves_at_a_time_forth_and_back(swing):
    moved = []
    for turn in range(8):
        positions = swing.at(TO_MIDDLE_S + (turn + 0.25) * SWING_PERIOD_S)
        moved += [joint for joint, position in enumerate(positions) if position]
    assert moved == [0, 1, 2, 1, 0, 1, 2, 1]


def test_no_joint_ever_leaves_its_limits(swing):
    for time_s in np.arange(TO_MIDDLE_S, TO_MIDDLE_S + 8 * SWING_PERIOD_S, 0.05):
        assert all(low <= position <= high for low, position, high in zip(LOWER, swing.at(time_s), UPPER))


def test_each_swing_begins_and_ends_at_rest_within_joint_velocities(swing):
    dt_s = 1e-3
    times = np.arange(TO_MIDDLE_S - 0.5, TO_MIDDLE_S + 4 * SWING_PERIOD_S, dt_s)
    velocities = np.diff([swing.at(time_s) for time_s in times], axis=0) / dt_s
    assert np.abs(velocities).max() < 1.9  # the slowest joint of the KUKA LWR: 1.92 rad/s
    assert np.abs(np.diff(velocities, axis=0)).max() / dt_s < 6.0


def test_joint_whose_limits_exclude_zero_moves_to_the_nearest():
    assert Swing((1.0,), (0.5,), (2.0,)).at(TO_MIDDLE_S) == (0.5,)


def test_joints_may_swing_about_another_place_than_zero():
    swing = Swing(START, LOWER, UPPER, (0.3, 1.9, 1.0), 0.2)
    assert swing.at(TO_MIDDLE_S) == (0.3, 1.9, 1.0)
    second = [swing.at(TO_MIDDLE_S + turn * SWING_PERIOD_S)[1] for turn in np.linspace(1.0, 2.0, 50)]
    assert 1.97 < max(second) < 2.0 and 1.8 < min(second) < 1.85
    third = [swing.at(TO_MIDDLE_S + turn * SWING_PERIOD_S)[2] for turn in np.linspace(2.0, 3.0, 51)]
    assert max(third) == pytest.approx(1.2, abs=0.01) and min(third) == pytest.approx(0.8, abs=0.01)


def test_panda_swings_without_self_collision():
    """Its guard would stop it, and did."""
    config = yaml.safe_load((EXAMPLES / "configs/basic_example_panda/panda.yaml").read_text())
    launch = ElementTree.parse(EXAMPLES / "launch/basic_example_panda.launch")
    node = next(each for each in launch.iter("node") if each.get("name") == "basic_robot_example")
    parameters = {each.get("name"): each.get("value") for each in node.iter("param")}
    robot = RobotModel(f"{pybullet_data.getDataPath()}/{config['loadURDF']['fileName']}", ARM)
    home = np.radians([config["initial_joint_position"].get(name, 0.0) for name in ARM])
    lower, upper = ([getattr(joint, side) for joint in robot.joints] for side in ("lower", "upper"))
    middle = home if parameters["about_start"] == "true" else None
    swing = Swing(home, lower, upper, middle, float(parameters["amplitude"]))
    distances = link_distances(robot)
    pairs = pairs_that_may_meet(robot, distances, MARGIN_M)
    assert len(pairs) > 20
    for time_s in np.arange(0.0, TO_MIDDLE_S + len(ARM) * SWING_PERIOD_S, 0.2):
        distances.place(np.array(swing.at(time_s)))
        near = [pair for pair in pairs if distances.distance(pair, 1.0) < MARGIN_M]
        assert not near, f"{near} after {time_s:.1f} s"


@pytest.mark.parametrize("robot", ["kinova", "talos", "nextage", "human_model"])
def test_all_joints_of_a_robot_swing(robot):
    folder = EXAMPLES / "configs" / f"basic_example_{robot}"
    config = next(yaml.safe_load(path.read_text()) for path in folder.glob("*.yaml") if path.stem != "config")
    model = RobotModel(find_file(config["loadURDF"]["fileName"], str(folder)))
    start = np.radians([config.get("initial_joint_position", {}).get(name, 0.0) for name in model.joint_names])
    swing = Swing(start, model.limits.lower, model.limits.upper, start, 0.3)
    turns = [swing.at(TO_MIDDLE_S + (index + 0.25) * SWING_PERIOD_S) for index in range(len(start))]
    ways = [abs(positions[index] - start[index]) for index, positions in enumerate(turns)]
    assert [name for name, way in zip(model.joint_names, ways) if way < 0.1] == []
