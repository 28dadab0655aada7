"""The servo of the arm pushes: limits, delays and offsets of a real velocity interface."""

from __future__ import annotations

import numpy as np
import pybullet
import pytest

from custom_ros_tools.errors import ConfigError
from rpbi.world import World
from rpbi.world.loading import load_world
from rpbi_reality.evaluation import world_file

SERVO = {
    "type": "rpbi_reality.pushes.velocity_servo:VelocityServo",
    "state_hz": 0.0,
    "start_s": 0.2,
    "schedule": [{"time_s": 0.0, "joints": {"shoulder": 30.0}}],
}


def angles(**keys) -> np.ndarray:
    """Returns the angle [deg] of the joint after each tick of 4 ms, for 2 s."""
    robot = {"file": "arm.yaml", "controllers": {"servo": {**SERVO, **keys}}}
    only_arm = {"robots": [robot], "dynamic_objects": None, "urdfs": None}
    world = World(
        load_world(world_file("identification/world.yaml"), overrides=only_arm), connection_mode=pybullet.DIRECT
    )
    try:
        arm, rows = world.bodies["arm"], []
        for _ in range(500):
            world.step()
            rows.append(next(iter(arm.joint_positions().values())))
        return np.degrees(rows)
    finally:
        world.close()


def test_joint_moves_at_the_limit_and_stops_at_its_target():
    angle = angles()
    assert abs(angle[:50]).max() < 1e-3
    assert np.diff(angle).max() / 0.004 == pytest.approx(30.0, rel=0.01)
    assert angle[-1] == pytest.approx(30.0, abs=0.1) and angle.max() < 30.1


def test_delay_in_the_loop_leads_to_overshoot():
    angle = angles(delay_s=0.12)
    assert abs(angle[: 50 + 29]).max() < 1e-3
    assert angle.max() > 30.5


def test_offset_shifts_the_joint():
    assert angles(offset_deg={"shoulder": 2.0})[-1] == pytest.approx(32.0, abs=0.1)


def test_unknown_joint_is_named():
    with pytest.raises(ConfigError, match="elbow"):
        angles(offset_deg={"elbow": 1.0})
