"""Inverse kinematics of a hand over a table."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from custom_ros_tools.errors import ConfigError, InterfaceError
from robot_model.asset_files import find_file
from rpbi_mpc.node_configs import PushingNodeConfig
from rpbi_mpc.pushing.hand import PlanarHand, PlanarHandConfig

EXAMPLE = "{rpbi_examples}/configs/pushing_mpc/mpc.yaml"


@pytest.fixture
def example() -> dict:
    with open(find_file(EXAMPLE, "test")) as file:
        return yaml.safe_load(file)


def test_hand_follows_the_path_at_its_height_with_stick_down(example):
    config = PlanarHandConfig.parse(example["hand"], EXAMPLE)
    hand = PlanarHand(config)
    joints = hand.solve(hand.posture, np.array([0.33, -0.37]))
    for share in np.linspace(0.0, 1.0, 60):
        place = np.array([0.33 - 0.08 * share, -0.37 + 0.3 * share])
        before, joints = joints, hand.solve(joints, place)
        assert np.allclose(hand.position(joints), (*place, config.height), atol=2e-4)
        assert np.abs(joints - before).max() < 0.3 or share == 0.0
        assert hand._pose(joints)[2, 2] == pytest.approx(-1.0, abs=1e-5)


def test_place_out_of_reach_is_an_error_that_names_it(example):
    hand = PlanarHand(PlanarHandConfig.parse(example["hand"], EXAMPLE))
    with pytest.raises(
        InterfaceError, match=r"hand.RHAND_ball: expected a place within reach, got \(2.000, 0.000, 0.680\)"
    ):
        hand.solve(hand.posture, np.array([2.0, 0.0]))


def test_configuration_whose_times_do_not_fit_is_refused(example):
    assert PushingNodeConfig.parse(example, EXAMPLE).loop.hz == 25
    for key, value, message in (
        ("hz", 20, r"pushing.cycle_s: expected the 0.05 s of a cycle of loop.hz, got 0.04"),
        ("delay_s", 0.015, r"loop.delay_s: expected a whole number of targets at plant.target_hz, got 1.5 in 0.015 s"),
    ):
        with pytest.raises(ConfigError, match=message):
            PushingNodeConfig.parse({**example, "loop": {**example["loop"], key: value}}, EXAMPLE)
