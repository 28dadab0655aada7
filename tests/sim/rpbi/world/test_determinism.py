"""Same inputs by tick, same samples, bit for bit."""

import subprocess
import sys

import deterministic_session as session
import pytest

from rpbi.world.load_log import replay


@pytest.mark.parametrize(
    "visitors",
    [
        pytest.param(False, id="same bodies", marks=pytest.mark.thorough),
        pytest.param(True, id="bodies come and go"),
    ],
)
def test_a_session_is_the_same_in_another_process(visitors):
    world = session.build()
    here = session.run(world, visitors=visitors)
    world.close()
    command = [sys.executable, session.__file__, *(["visitors"] if visitors else [])]
    there = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert here == there


def test_session_is_identical_in_a_world_built_after_others():
    hashes = set()
    for _ in range(2):
        world = session.build()
        hashes.add(session.run(world))
        world.close()
    assert len(hashes) == 1


def test_a_target_at_another_tick_changes_the_session():
    world = session.build()
    shorter = session.run(world, ticks=100)
    world.step()
    other = session.run(world, ticks=100)
    world.close()
    assert shorter != other


def test_the_log_rebuilds_the_world():
    reference = session.build()
    rebuilt = session.build()
    before = {name: body.state() for name, body in reference.bodies.items()}
    again = replay(rebuilt.pb, reference.log)
    assert {name: body.state() for name, body in again.items()} == before
    for _ in range(1000):
        reference.pb.stepSimulation()
        rebuilt.pb.stepSimulation()
    assert {n: b.state() for n, b in again.items()} == {n: b.state() for n, b in reference.bodies.items()}
    reference.close()
    rebuilt.close()
