"""Dynamic objects that follow TF while it sees them, and physics in between."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from scripted_session import recorded
from worlds import FLOOR, box, write_world

from custom_ros_tools.errors import ConfigError
from robot_model.geometry import rotation_between
from rpbi.bodies.visual_shapes import followed_frame
from rpbi.geometry import Pose
from rpbi.replay.session import Checkpoint, Recording, Replay
from rpbi.world import World
from rpbi.world.saved.description import WorldDescription

DT_S = 0.001
HZ = 50
LAG_S = 1.5 / HZ
SPEED = 0.3


@pytest.fixture
def build(tmp_path) -> Iterator[Callable[..., World]]:
    """Builds a world with a box that is tracked and another before it on the floor."""
    worlds = []

    def build_world(**keys: Any) -> World:
        tracked = box("box", basePosition=[0.0, 0.0, 1.0], **{"tracked_tf": {"tf_id": "seen", "hz": HZ}, **keys})
        other = box("other", basePosition=[0.5, 0.0, 0.1])
        worlds.append(World.from_file(write_world(tmp_path, dynamic=(tracked, other), collision=(FLOOR,))))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def follow(world: World, pose_at: Callable[[float], Pose], seconds: float) -> Iterator[float]:
    """Runs a world while poses come; yields the time after each tick."""
    start = world.clock.tick
    for tick in range(round(seconds / DT_S)):
        if tick % round(1.0 / HZ / DT_S) == 0:
            world.put("box/pose", pose_at(tick * DT_S))
        world.step()
        yield (world.clock.tick - start) * DT_S


def pose(world: World, name: str = "box") -> Pose:
    """Returns where a box is."""
    return world.bodies[name].base_pose()


def test_tracked_body_keeps_to_its_path_despite_gravity(build) -> None:
    world = build()

    def pose_at(t: float) -> Pose:
        return Pose((SPEED * t, 0.0, 2.0), (0.0, 0.0, math.sin(t), math.cos(t)))

    for t in follow(world, pose_at, 0.5):
        if t > 0.1:
            expected = pose_at(t - LAG_S)
            assert pose(world).position == pytest.approx(expected.position, abs=5e-4)
            assert math.hypot(*rotation_between(pose(world).quat_xyzw, expected.quat_xyzw)) < 3e-3
    assert world.bodies["box"].base_twist().linear == pytest.approx((SPEED, 0.0, 0.0), abs=1e-3)


def test_tracked_body_pushes_others_at_its_own_velocity(build) -> None:
    world = build()
    speeds = []
    for t in follow(world, lambda t: Pose((0.2 + SPEED * t, 0.0, 0.1)), 1.0):
        if t > 0.7:
            speeds.append(world.bodies["other"].base_twist().linear[0])
    assert sum(speeds) / len(speeds) == pytest.approx(SPEED, rel=0.01)
    assert pose(world, "other").position[0] - pose(world).position[0] == pytest.approx(0.2, abs=2e-3)


def test_unseen_body_follows_physics_and_returns_along_a_path(build, caplog) -> None:
    timeout_s = 0.02
    world = build(tracked_tf={"tf_id": "seen", "hz": HZ, "timeout_s": timeout_s})
    for _ in follow(world, lambda t: Pose((SPEED * t, 0.0, 2.0)), 0.5):
        pass
    start = pose(world).position
    thrown_s = 0.3
    for _ in range(round(thrown_s / DT_S)):
        world.step()
    here = pose(world).position
    assert start[2] - here[2] == pytest.approx(0.5 * 9.81 * thrown_s**2, rel=0.01)
    assert here[0] - start[0] == pytest.approx(SPEED * thrown_s, rel=0.05), "it keeps the velocity that it had"
    last = here
    with caplog.at_level(logging.WARNING):
        for _ in follow(world, lambda _: Pose((0.2, 0.0, 1.7)), 0.5):
            assert math.dist(pose(world).position, last) < 5.0 * DT_S, "no faster than max_speed"
            last = pose(world).position
    assert last == pytest.approx((0.2, 0.0, 1.7), abs=1e-6)
    assert caplog.text == "", "no jump"


def test_teleported_body_follows_physics_until_it_is_seen_again(build) -> None:
    world = build()
    list(follow(world, lambda _: Pose((0.0, 0.0, 1.0)), 0.1))
    world.act("box", "teleport", Pose((0.0, 1.0, 1.0)))
    for _ in range(100):
        world.step()
    assert pose(world).position == pytest.approx((0.0, 1.0, 1.0 - 0.5 * 9.81 * 0.1**2), abs=2e-3)
    list(follow(world, lambda _: Pose((0.0, 1.0, 1.0)), 0.2))
    assert pose(world).position == pytest.approx((0.0, 1.0, 1.0), abs=1e-6)


def test_session_with_lost_tracking_is_identical_when_replayed(build) -> None:
    world = build(tracked_tf={"tf_id": "seen", "hz": HZ, "timeout_s": 0.05})
    description = world.describe()
    states = set()
    for _ in range(3):
        for _ in follow(world, lambda t: Pose((0.2 + SPEED * t, 0.01 * math.sin(9.0 * t), 0.12)), 0.3):
            pass
        for _ in range(200):
            world.step()
        states.add(Checkpoint(0, world.clock.tick, world.commands.count, world.state_hash()))
    result = Replay(Recording(WorldDescription(description), {0: recorded(world)}, states)).run()
    assert (result.difference, result.left_out, result.agreed) == (None, (), len(states) + 1)


def test_marker_is_at_the_body_not_at_the_seen_frame(build) -> None:
    assert followed_frame(build().bodies["box"]) is None


def test_maximal_coordinates_follow_nothing(build) -> None:
    with pytest.raises(ConfigError, match="useMaximalCoordinates: a body in maximal coordinates cannot follow TF"):
        build(useMaximalCoordinates=True)
