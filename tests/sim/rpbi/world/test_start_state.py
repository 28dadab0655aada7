"""Resets that keep the bodies lead to the same start as those that load them again, or do load them again."""

from __future__ import annotations

import gym_world
import numpy as np
import pytest
from worlds import FLOOR, ball, write_world

from rpbi.world import World


@pytest.fixture
def world(tmp_path):
    world = World.from_file(gym_world.write(tmp_path))
    world.reset(rebuild=False)
    yield world
    world.close()


def session(world: World, seed: int, ticks: int = 400) -> str:
    """Knocks a box that is somewhere else and of another mass and friction each time; returns the hash at the end."""
    draw = np.random.default_rng(seed)
    x, y = draw.uniform((0.3, 0.1), (0.4, 0.2)).tolist()
    world.act("box", "teleport", {"position": [x, y, 0.05]})
    if draw.random() < 0.5:
        world.change_dynamics("box", {"mass": draw.uniform(0.2, 2.0), "lateralFriction": draw.uniform(0.1, 0.9)})
    for tick in range(ticks):
        if tick % 20 == 0:
            world.put("arm/target", {"swing": float(draw.uniform(-0.2, 1.2))})
        world.step()
    assert world.bodies["box"].base_pose().position != (x, y, 0.05)
    return world.state_hash()


def test_sessions_are_those_after_loading_again(world):
    arm, start = world.bodies["arm"], world.start_hash
    ends = []
    for rebuild in (False, True):
        found = {}
        for seed in np.random.default_rng(0).permutation(25).tolist() if rebuild else range(25):
            world.reset(rebuild)
            assert (world.clock.tick, world.state_hash(), world.commands.count) == (0, start, 0)
            found[seed] = session(world, seed)
        ends.append(found)
        assert (world.bodies["arm"] is arm) is not rebuild
    assert ends[0] == ends[1] and len(set(ends[0].values())) == 25


def test_body_with_irreversible_changes_is_loaded_again(world):
    def does(what) -> bool:
        world.reset(rebuild=False)
        world.reset(rebuild=False)
        arm = world.bodies["arm"]
        world.step()
        what()
        world.step()
        world.reset(rebuild=False)
        assert world.state_hash() == world.start_hash
        return arm is not world.bodies["arm"]

    assert not does(lambda: world.act("arm", "move", {"positions": {"swing": 1.0}, "duration_s": 0.1}))
    assert does(lambda: world.add("dynamic", ball()))
    assert does(lambda: world.act("arm", "switch_mode", "VELOCITY_CONTROL"))
    assert does(lambda: world.put("box/external_wrench", {"force": [1.0, 0.0, 0.0]}))
    assert does(lambda: world.change_dynamics("box", {"lateralFriction": 0.2}))  # in contact
    assert does(lambda: world.attach({"name": "rope", "parent": "arm/bar", "child": "box", "kind": "ball"}))


def test_state_saved_after_a_reset_without_rebuild_is_restored(world):
    session(world, 1)
    world.reset(rebuild=False)
    end = session(world, 2)
    with_commands = world.save()
    world.restore(with_commands)
    assert world.state_hash() == end


def test_bodies_with_a_state_of_their_own_are_loaded_again(tmp_path):
    sensor = {"enabled_joint_force_torque_sensors": [{"joint": "swing", "hz": 100}]}
    several = ball("first"), ball("second", basePosition=[0.0, 0.0, 1.0])
    paths = [gym_world.write(tmp_path, **sensor)]
    for number, things in enumerate(((ball(useMaximalCoordinates=True),), several)):
        (folder := tmp_path / str(number)).mkdir()
        paths.append(write_world(folder, dynamic=things))
    for path in paths:
        world = World.from_file(path)
        world.reset(rebuild=False)
        before = list(world.bodies.values())
        world.step()
        world.reset(rebuild=False)
        assert world.state_hash() == world.start_hash
        assert not set(before) & set(world.bodies.values())
        world.close()


@pytest.mark.parametrize("state", ["ENABLE_SLEEPING", "ENABLE_SLEEPING|ACTIVATION_STATE_SLEEP"])
def test_bodies_that_fell_asleep_fall_again(tmp_path, state):
    dynamics = {"activationState": f"ACTIVATION_STATE_{state}"}
    thing = ball(basePosition=[0.0, 0.0, 0.5], changeDynamics=dynamics)
    world = World.from_file(write_world(tmp_path, collision=(FLOOR,), dynamic=(thing,), timeStep=0.005))
    heights = []
    for _ in range(2):
        world.reset(rebuild=False)
        for _ in range(500):
            world.step()
            heights.append(world.bodies["ball"].base_pose().position[2])
    assert heights[:500] == heights[500:]
    world.close()
