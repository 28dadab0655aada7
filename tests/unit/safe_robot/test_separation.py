"""Lower bounds of distances, held against the distances that PyBullet measures."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from guarded_arm import KUKA

from robot_model.collision.separation import Separation
from robot_model.collision.shapes import Obstacle
from robot_model.geometry import Pose, normalized
from robot_model.model import RobotModel
from safe_robot.checks.proximity_check import link_distances
from safe_robot.checks.self_collision import pairs_that_may_meet

FAR_M = 10.0
LOOSE_M = 0.015
"""What balls of both shapes may be too large [m]."""
CORNERS = tuple(tuple(corner) for corner in np.random.default_rng(7).normal(0.0, 0.15, (100, 3)).tolist())
MESH = str(Path(KUKA).parent / "kuka_lwr/base.obj")
OBSTACLES = (
    Obstacle("box", "box", (0.4, 0.3, 0.2), Pose((0.9, 0.2, 0.3), normalized((0.1, 0.5, -0.3, 0.8)))),
    Obstacle("sphere", "sphere", (0.2, 0.2, 0.2), Pose((-0.9, 0.2, 0.3))),
    Obstacle("cylinder", "cylinder", (0.2, 0.2, 0.6), Pose((-0.5, -0.9, 0.6), normalized((0.4, 0.1, 0.3, 0.8)))),
    Obstacle("capsule", "capsule", (0.2, 0.2, 0.6), Pose((0.5, -0.9, 0.6), normalized((0.4, -0.1, 0.3, 0.8)))),
    Obstacle("plane", "plane", (1.0, 1.0, 1.0), Pose((0.0, 0.0, -1.5), normalized((0.1, 0.0, 0.0, 1.0)))),
    Obstacle("points", "points", (1.0, 1.0, 1.0), Pose((0.9, 0.9, 0.6), normalized((0.2, 0.1, 0.3, 0.8))), "", CORNERS),
    Obstacle("mesh", "mesh", (1.5, 1.0, 1.0), Pose((-0.9, 0.9, 0.6), normalized((0.2, 0.6, 0.3, 0.8))), MESH),
)


@pytest.fixture(scope="module")
def distances():
    distances = link_distances(RobotModel(KUKA))
    distances.place_obstacles(OBSTACLES)
    return distances


@pytest.fixture(scope="module")
def pairs(distances):
    moving = [link for link in distances.links if distances.reach((link, 0)).any()]
    own = pairs_that_may_meet(RobotModel(KUKA), distances, 0.01)
    return [*own, *((link, i) for i in range(len(OBSTACLES)) for link in moving)]


def bounds_and_distances(distances, pairs, separation, q, learn=False):
    """Returns the bounds in a configuration, after directions were taken there or not, and what is measured."""
    frames = distances.frames(q[None])
    distances.place(q)
    contacts = [distances.contact(pair, FAR_M) for pair in pairs]
    if learn:
        for i, contact in enumerate(contacts):
            separation.learn(i, contact.directions, frames[0])
    bounds = separation.lower_bounds(frames, np.arange(len(pairs)))[0]
    return bounds, np.array([contact.distance for contact in contacts])


def too_large(distances, pairs, separation) -> int:
    """Returns how many bounds are larger than the distance, in random configurations near and far from learnt ones."""
    generator = np.random.default_rng(1)
    found = 0
    for _ in range(6):
        q = generator.uniform(-2.0, 2.0, 7)
        bounds_and_distances(distances, pairs, separation, q, learn=True)
        for spread in (0.0, 0.02, 0.3, 2.0):
            moved = q + generator.normal(0.0, spread, 7)
            bounds, measured = bounds_and_distances(distances, pairs, separation, moved)
            found += np.count_nonzero(~(bounds <= np.maximum(measured, 0.0)))
    return found


def separation_of(distances, pairs, shrunk_m=0.0):
    """Returns the separation of pairs; with the first thing of each made smaller it has to be wrong."""
    both = [(distances.solids(a), distances.solids(b)) for a, b in pairs]
    shrink = np.array((0.0, 0.0, 0.0, shrunk_m))
    return Separation([([each._replace(balls=each.balls - shrink) for each in a], b) for a, b in both])


def test_a_bound_is_never_above_the_distance(distances, pairs):
    assert too_large(distances, pairs, separation_of(distances, pairs)) == 0


def test_shapes_that_are_too_small_would_show(distances, pairs):
    assert too_large(distances, pairs, separation_of(distances, pairs, shrunk_m=0.008)) > 100


def test_where_directions_were_taken_a_bound_is_near_the_distance(distances, pairs):
    separation = separation_of(distances, pairs)
    q = np.array((0.3, 0.6, -0.2, -1.2, 0.1, 0.8, 0.0))
    bounds, measured = bounds_and_distances(distances, pairs, separation, q)
    half_spaces = [i for i, (_, b) in enumerate(pairs) if not isinstance(b, str) and OBSTACLES[b].kind == "plane"]
    assert np.flatnonzero(np.isfinite(bounds)).tolist() == half_spaces, "without a direction nothing is known"
    bounds, measured = bounds_and_distances(distances, pairs, separation, q, learn=True)
    apart = measured > 0.0
    assert np.count_nonzero(apart) > 0.9 * len(pairs) and (measured - bounds)[apart].max() < LOOSE_M


def test_an_obstacle_that_moves_is_taken_where_it_is(distances, pairs):
    number = next(i for i, each in enumerate(OBSTACLES) if each.kind == "points")
    chosen = [pair for pair in pairs if pair[1] == number]
    separation = separation_of(distances, chosen)
    q = np.zeros(7)
    before, _ = bounds_and_distances(distances, chosen, separation, q, learn=True)
    near = OBSTACLES[number]._replace(pose=Pose((0.4, 0.4, 0.6), normalized((0.2, 0.1, 0.3, -0.8))))
    try:
        assert distances.place_obstacles((*OBSTACLES[:number], near, *OBSTACLES[number + 1 :])) == [number]
        for i, pair in enumerate(chosen):
            separation.replace(i, distances.solids(pair[1]))
        after, measured = bounds_and_distances(distances, chosen, separation, q)
    finally:
        distances.place_obstacles(OBSTACLES)
    assert (after <= measured).all() and (after < before - 0.2).all()


BENT = """<robot name="bent"><link name="base"/>
  <link name="hand">
    <inertial><origin xyz="0.1 -0.2 0.3" rpy="0.4 0.5 0.6"/><mass value="1"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><origin xyz="0.2 0 0.1" rpy="0.3 0.7 -0.5"/><geometry><box size="0.4 0.1 0.1"/></geometry></collision>
    <collision><origin xyz="0 0.3 0" rpy="1 -1 0.5"/>
      <geometry><cylinder radius="0.05" length="0.4"/></geometry></collision>
    <collision><origin xyz="-0.3 0 -0.3"/><geometry><sphere radius="0.08"/></geometry></collision>
  </link>
  <joint name="slide" type="prismatic"><parent link="base"/><child link="cart"/><origin xyz="0 0 0.2" rpy="0 0.3 0"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="2"/></joint>
  <link name="cart">
    <collision><origin xyz="0 0 -0.3" rpy="1 1 0.5"/>
      <geometry><mesh filename="{mesh}" scale="1 0.5 1"/></geometry></collision>
  </link>
  <joint name="plate" type="fixed"><parent link="cart"/><child link="plate"/>
    <origin xyz="0.1 0 0" rpy="0.2 0 0.4"/></joint>
  <link name="plate"/>
  <joint name="turn" type="continuous"><parent link="plate"/><child link="hand"/><origin rpy="0 0.3 0.2"/>
    <axis xyz="0.6 0 0.8"/></joint>
</robot>"""


def test_shapes_are_where_the_description_puts_them(tmp_path):
    path = tmp_path / "bent.urdf"
    path.write_text(BENT.format(mesh=MESH))
    robot = RobotModel(str(path))
    distances = link_distances(robot)
    distances.place_obstacles([OBSTACLES[0]._replace(pose=Pose((0.0, 0.0, -2.0)))])
    pairs = [("hand", 0), ("cart", 0)]
    separation = separation_of(distances, pairs)
    assert [len(distances.solids(link)) for link, _ in pairs] == [3, 1]
    for q in np.random.default_rng(2).uniform(-1.0, 1.0, (20, 2)):
        for link in ("hand", "plate"):
            frame, place = robot.frames.place(link)
            origin = (robot.frames.at(q[None])[0, frame] @ place)[:3, 3]
            np.testing.assert_allclose(origin, robot.frames.positions(q[None], link)[0], atol=1e-12)
        bounds, measured = bounds_and_distances(distances, pairs, separation, q, learn=True)
        assert (bounds <= measured).all() and (measured - bounds < LOOSE_M).all()


def test_unknown_distance_gives_no_bound(distances, pairs):
    separation = separation_of(distances, pairs[:1])
    separation.learn(0, [(math.nan, 0.0, 0.0)], distances.frames(np.zeros((1, 7)))[0])
    assert not separation.lower_bounds(distances.frames(np.zeros((1, 7))), np.array((0,)))[0, 0] > 0.0
