"""Still scenes: robots hold their poses, and nothing falls."""

from __future__ import annotations

import math
from pathlib import Path

import pybullet
import pytest

from rpbi.bodies.robots.robot import Robot
from rpbi.samples import LinkPoseSample
from rpbi.world import World

CONFIGS = Path(__file__).parents[3] / "src/rpbi_examples/configs"
POSES = ("run_pose_human_model", "run_pose_kinova", "run_pose_kuka_lwr", "run_pose_talos", "optas_kuka_lwr_expr", "nsl")


@pytest.mark.parametrize("name", POSES)
def test_robot_holds_its_pose_and_nothing_falls(name):
    world = World.from_file(str(CONFIGS / name / "config.yaml"), connection_mode=pybullet.DIRECT)
    (robot,) = (body for body in world.bodies.values() if isinstance(body, Robot))
    start, heights = robot.joint_positions(), _heights(world)
    for _ in range(300):
        world.step()
    turned = {joint: math.degrees(abs(at - start[joint])) for joint, at in robot.joint_positions().items()}
    assert max(turned.values()) < 2.0
    assert _heights(world) == pytest.approx(heights, abs=0.005)
    world.close()


def test_kinova_has_its_hand_at_the_cup():
    world = World.from_file(str(CONFIGS / "run_pose_kinova/config.yaml"), connection_mode=pybullet.DIRECT)
    samples = [sample for _ in range(20) for sample in world.step() if isinstance(sample, LinkPoseSample)]
    poses = {frame: pose for sample in samples for frame, pose in zip(sample.frames, sample.poses)}
    hand = poses["rpbi/kinova/j2s6s200_link_6"].position
    assert math.dist(hand, world.bodies["cup"].base_pose().position) < 0.25
    world.close()


def _heights(world: World) -> dict[str, float]:
    return {name: body.base_pose().position[2] for name, body in world.bodies.items()}
