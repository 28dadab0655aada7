"""Joints that slide in what others turn: how far links go then hangs on how far they are out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from guarded_arm import decide, guard_of

from custom_ros_tools.errors import ConfigError
from robot_model.model import MAX_OUTSIDE, RobotModel
from safe_robot.guard import Guard

CRANE = """<robot name="crane"><link name="base"/><link name="boom"/><link name="trolley"/><link name="hook"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="boom"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="3"/></joint>
  <joint name="reach" type="prismatic"><parent link="boom"/><child link="trolley"/><axis xyz="1 0 0"/>
    <limit {limits} effort="1" velocity="2"/></joint>
  <joint name="follower" type="prismatic"><parent link="trolley"/><child link="hook"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.1" effort="1" velocity="2"/>
    <mimic joint="reach" multiplier="2" offset="0.25"/></joint>
</robot>"""


def crane(folder: Path, limits: str = 'lower="0" upper="1"') -> RobotModel:
    path = folder / "crane.urdf"
    path.write_text(CRANE.format(limits=limits))
    return RobotModel(str(path))


def started(robot: RobotModel, out: float, **config: object) -> Guard:
    guard = guard_of(robot, **config)
    assert decide(guard, (0.0, out)).violation is None
    return guard


@pytest.mark.parametrize("link", ["trolley", "hook"])
def test_link_displacement_is_bounded_by_its_reach_from_any_start(tmp_path, link):
    robot = crane(tmp_path)
    assert robot.telescopic == ("reach",)
    reach, chance = robot.reach(link, 0.0), np.random.default_rng(4)
    low, high = np.array((-3.0, -MAX_OUTSIDE)), np.array((3.0, 1.0 + MAX_OUTSIDE))
    q = chance.uniform(low, high, (2000, 2))
    q[::2, 1] = high[1]  # where the boom is longest
    after = np.clip(q + chance.uniform(-0.1, 0.1, q.shape), low, high)
    way = np.linalg.norm(robot.frames.positions(after, link) - robot.frames.positions(q, link), axis=1)
    shares = way / (np.abs(after - q) @ reach)
    assert 0.5 < shares.max() <= 1.0


def test_a_joint_that_is_further_outside_may_not_start(tmp_path):
    robot = crane(tmp_path)
    started(robot, 1.0 + 0.99 * MAX_OUTSIDE)
    violation = decide(guard_of(robot), (0.0, 1.0 + 1.5 * MAX_OUTSIDE)).violation
    assert violation[:4] == ("start", "joint 'reach'", pytest.approx(0.15), MAX_OUTSIDE)
    assert str(violation) == "start: joint 'reach': distance beyond its limits is 0.15 m, limit 0.1 m"
    violation = decide(guard_of(robot), (0.0, -1.5 * MAX_OUTSIDE)).violation
    assert violation[:2] == ("start", "joint 'reach'")


def test_a_link_is_no_faster_where_the_boom_is_longest(tmp_path):
    """The turn may be as fast as 1 rad/s; the trolley is 1.05 m out, and may be as fast as 0.3 m/s."""
    guard = started(crane(tmp_path), 1.05, checks={"link_velocity": {"links": {"trolley": 0.3}}})
    angle, speed, fastest = 0.0, 0.0, 0.0
    while (decision := decide(guard, (angle, 1.05))).violation is None:
        fastest, speed = speed, speed + 0.002
        angle += 0.01 * speed
    assert decision.violation[:2] == ("link_velocity", "link 'trolley'")
    assert 0.9 < 1.05 * fastest / 0.3 <= 1.0


def test_telescopic_reach_requires_position_limits_and_their_check(tmp_path):
    with pytest.raises(
        ConfigError,
        match=r"checks.joint_position.active: expected true, since joint 'reach' moves links that others turn",
    ):
        guard_of(crane(tmp_path), checks={"joint_position": {"active": False}})
    boundless = crane(tmp_path, 'lower="0" upper="0"')
    with pytest.raises(ConfigError, match="expected limits for prismatic joints between joint 'turn' and"):
        guard_of(boundless, checks={"link_velocity": {"links": {"trolley": 0.3}}})
    assert guard_of(boundless).joint_names == ("turn", "reach")
