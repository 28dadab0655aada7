"""An arm that is commanded by the best of its own predictions."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import costs
import numpy as np
import pytest
from worlds import iiwa, write_world

from custom_ros_tools.errors import ConfigError, InterfaceError
from rpbi.world import World
from rpbi_mpc import LockStep, LoopConfig
from rpbi_mpc.sampling import ForkedWorld, InputConfig, SamplingConfig, SamplingController

JOINT = "lbr_iiwa_joint_2"
INPUT = {"input": "iiwa/target", "names": [JOINT], "lower": [-1.0], "upper": [1.0]}
HZ = 20.0


@pytest.fixture
def world(tmp_path, monkeypatch) -> Iterator[World]:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((str(Path(costs.__file__).parent), *sys.path)))
    world = World.from_file(write_world(tmp_path, robots=(iiwa(),)))
    yield world
    world.close()


def run(world: World, cost: str = "costs:turned", delay_s: float = 0.01) -> LockStep:
    plant = ForkedWorld(world, InputConfig.parse(INPUT, "input"), cost)
    config = SamplingConfig(horizon=0.4, knots=2, sampler={"type": "predictive", "candidates": 8, "noise": 0.2})
    controller = SamplingController(plant, config, HZ, np.zeros(1))
    loop = LockStep(plant, controller, LoopConfig(hz=HZ, delay_s=delay_s))
    loop.run(1.0)
    return loop


@pytest.mark.thorough
def test_arm_reaches_the_least_cost_reproducibly(world):
    loop = run(world)
    assert list(world.bodies["iiwa"].joint_positions().values())[1] == pytest.approx(0.6, abs=0.06)
    assert {str(each.status) for each in loop.cycles} == {"solved"}
    reached = world.state_hash()
    world.reset()
    run(world)
    assert world.state_hash() == reached, "no decision depends on the speed of the computer"


def test_a_cost_that_fails_stops_the_loop_and_names_it(world):
    loop = run(world, "costs:endless")
    assert loop.is_over and "no candidate could be simulated" in loop.cycles[-1].reason


def test_times_are_whole_ticks(world):
    with pytest.raises(InterfaceError, match="expected a whole number of ticks of 0.00.* s, got 0.0123 s"):
        run(world, delay_s=0.0123)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"upper": [-2.0]}, "upper: expected numbers above those of lower"),
        ({"lower": [-1.0, 0.0]}, "lower: expected 1 finite numbers, one for each name"),
        ({"start": [], "nmes": []}, "nmes: unknown key"),
    ],
)
def test_wrong_limits_are_named(change, message):
    with pytest.raises(ConfigError, match=message):
        InputConfig.parse({**INPUT, **change}, "input")
