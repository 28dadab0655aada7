"""The hash of a world's state."""

from __future__ import annotations

import subprocess
import sys

import deterministic_session as session
import pytest
from worlds import FLOOR, ball, iiwa, write_world

from rpbi.world import World
from rpbi.world.contents import state_hash

IN_ANOTHER_PROCESS = """
import sys
from rpbi.world import World
world = World.from_file(sys.argv[1])
for _ in range(200):
    world.step()
print("hash:", world.state_hash())
"""


@pytest.fixture
def path(tmp_path):
    return write_world(tmp_path, collision=(FLOOR,), dynamic=(ball(basePosition=[0, 1, 0.15]),), robots=(iiwa(),))


@pytest.fixture
def world(path):
    world = World.from_file(path)
    yield world
    world.close()


def test_it_is_the_same_in_another_process(world, path):
    for _ in range(200):
        world.step()
    command = [sys.executable, "-c", IN_ANOTHER_PROCESS, path]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert f"hash: {world.state_hash()}" in printed


def test_hash_changes_every_tick_and_reading_it_changes_nothing(path):
    hashes = []
    for read_often in (True, False):
        world = World.from_file(path)
        seen = set()
        for _ in range(100):
            world.step()
            if read_often:
                seen.add(world.state_hash())
        hashes.append(world.state_hash())
        world.close()
        if read_often:
            assert len(seen) == 100
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize(
    "disturb",
    [
        lambda pb, ball, arm: pb.resetBasePositionAndOrientation(ball, (0.0, 1.0 + 2e-16, 0.15), (0, 0, 0, 1)),
        lambda pb, ball, arm: pb.resetBaseVelocity(ball, (0.0, 0.0, 5e-324), (0, 0, 0)),
        lambda pb, ball, arm: pb.resetBaseVelocity(ball, (0, 0, 0), (1e-300, 0.0, 0.0)),
        lambda pb, ball, arm: pb.resetJointState(arm, 3, 1e-300),
        lambda pb, ball, arm: pb.resetJointState(arm, 3, 0.0, 1e-300),
    ],
    ids=["position", "velocity", "rotation", "joint", "joint velocity"],
)
def test_the_last_bit_of_anything_counts(world, disturb):
    before = world.state_hash()
    disturb(world.pb, world.bodies["ball"].body_id, world.bodies["iiwa"].body_id)
    assert world.state_hash() != before


def test_hash_ignores_the_order_of_bodies_but_not_their_names(world):
    reversed_order = dict(reversed(world.bodies.items()))
    assert state_hash(0, reversed_order) == world.state_hash()
    renamed = {"bell" if name == "ball" else name: body for name, body in world.bodies.items()}
    assert state_hash(0, renamed) != world.state_hash()


def test_worlds_that_differ_by_one_target_have_different_hashes():
    world = session.build()
    session.run(world, ticks=100)
    one = world.state_hash()
    world.reset()
    world.put("iiwa/target", session.JointCommand(["lbr_iiwa_joint_7"], [0.1]))
    session.run(world, ticks=100)
    assert world.state_hash() != one
    world.close()
