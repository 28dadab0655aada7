"""Two arms reach into a bookcase while blocks pass by: what is blocked, when an arm yields, and how it is judged."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from robot_model.geometry import Pose
from rpbi_examples.scenes import shelves
from rpbi_examples.scenes.parts.yielding import YieldingArm
from rpbi_examples.scenes.scene import Seen
from rpbi_examples.scenes.shelves import BASES, CYCLE_S, RAILS, Shelves, blocking
from rpbi_examples.scenes.task import make_env, run_episode

HOME = np.radians([0.0, -20.0, 0.0, -110.0, 0.0, 0.0, 0.0])
IN_FRONT = np.radians([0.0, 40.0, 0.0, -60.0, 0.0, -10.0, 0.0])


@pytest.fixture(scope="module")
def env():
    found = make_env("shelves")
    yield found
    found.close()


def scene_with(**carriages: float) -> Shelves:
    scene = Shelves(np.random.default_rng(1))
    scene.seen = Seen(joints={name: {"rail_joint": at} for name, at in carriages.items()})
    return scene


def visit(scene: Shelves, cycles: int) -> list[float]:
    """Returns the second joint of an arm that is led to `IN_FRONT` and back, cycle by cycle."""
    names = [f"joint_{i}" for i in range(7)]
    arm = YieldingArm(scene, "left", names, blocking("left"), CYCLE_S)
    times = np.linspace(0.0, 2.0, 41)
    trajectory = SimpleNamespace(times=times, positions=HOME + np.outer(times / 2.0, IN_FRONT - HOME))
    found = []
    for _, _ in zip(range(cycles), arm.visit(trajectory, 0.2)):
        found.append(scene.take_changes()[-1].value["joint_1"])
    return found


def test_carriage_blocks_the_lane_of_an_arm():
    lower, upper = blocking("left").along(np.array([HOME, HOME, HOME]))
    assert not lower.any() and not upper.any()
    tables = blocking("left").along(np.array([IN_FRONT, IN_FRONT, IN_FRONT]))
    blocked = np.any([table.any(axis=0) for table in tables], axis=0)
    assert blocked.any() and not blocked.all()
    cells = np.flatnonzero(blocked) * 0.03 - RAILS[0].half_m
    assert abs(np.mean(cells) - BASES["left"].position[1]) < 0.1


def test_arm_advances_if_carriages_are_far():
    found = visit(scene_with(lower_carriage=-1.1, upper_carriage=-1.1), 1000)
    assert max(found) == pytest.approx(IN_FRONT[1]) and found[-1] == pytest.approx(HOME[1])


def test_arm_waits_while_a_carriage_is_in_its_lane():
    found = visit(scene_with(lower_carriage=0.55, upper_carriage=0.55), 500)
    assert max(found) < IN_FRONT[1] - 0.1 and len(found) == 500


def test_arm_retreats_from_a_carriage_that_comes():
    scene = scene_with(lower_carriage=-1.1, upper_carriage=-1.1)
    names = [f"joint_{i}" for i in range(7)]
    arm = YieldingArm(scene, "left", names, blocking("left"), CYCLE_S)
    times = np.linspace(0.0, 2.0, 41)
    trajectory = SimpleNamespace(times=times, positions=HOME + np.outer(times / 2.0, IN_FRONT - HOME))
    places, at = [], -1.1
    for _, _ in zip(range(2000), arm.visit(trajectory, 1000.0)):
        places.append(scene.take_changes()[-1].value["joint_1"])
        if max(places) > IN_FRONT[1] - 1e-6:
            at = min(at + RAILS[0].speed * CYCLE_S, 0.55)
        scene.seen = Seen(joints={rail.robot: {"rail_joint": at} for rail in RAILS})
    assert max(places) == pytest.approx(IN_FRONT[1]) and places[-1] < IN_FRONT[1] - 0.1


@pytest.mark.thorough
def test_both_arms_reach_their_goals(env):
    result = run_episode(env, 4001)
    assert result.success and result.done == 4, result


@pytest.mark.thorough
def test_arms_that_do_not_yield_touch_a_carriage(env, monkeypatch):
    monkeypatch.setattr(YieldingArm, "_is_safe", lambda *_: True)
    results = [run_episode(env, seed) for seed in range(4001, 4006)]
    assert any(result.reason.startswith("touched: ") for result in results), results


def test_a_touch_counts_as_a_failure(env):
    scene = env.task.scene
    touch = SimpleNamespace(other="upper_carriage")
    scene.visited = {name: shelves.GOALS for name in BASES}
    scene._touched = set()
    assert scene.has_succeeded()
    joints = {name: dict.fromkeys(env.world.bodies, 0.0) for name in BASES}
    scene.seen = Seen(joints=joints, contacts={"left": (touch,), "right": ()})
    scene.note()
    assert not scene.has_succeeded() and scene.fault() == "touched: upper_carriage" and scene.score() == (0, 4)


def test_goals_are_in_compartments_of_the_own_side():
    for seed in range(20):
        for name, goals in Shelves(np.random.default_rng(seed)).goals.items():
            side = 1.0 if BASES[name].position[1] > 0.0 else -1.0
            assert all(0.1 < side * goal.position[1] < 0.65 and isinstance(goal, Pose) for goal in goals)
