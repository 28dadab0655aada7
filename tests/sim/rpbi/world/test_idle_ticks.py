"""Ticks at which physics alone acts are cheap, and the same as all others."""

import math
import sys
from collections import Counter

import pytest
from worlds import FLOOR, ball, iiwa, write_world

from rpbi.bodies.robots.robot import Robot
from rpbi.world import World
from rpbi.world.world import MAX_IDLE_ROW

TICKS = 1000
PUSH_TICK = 333
PUSH = {"lbr_iiwa_joint_2": 0.4}


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(**keys):
        parts = {"collision": (FLOOR,), "dynamic": (ball(basePosition=[0.6, 0.0, 1.0]),), "robots": (iiwa(**keys),)}
        worlds.append(World.from_file(write_world(tmp_path, **parts)))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def _by_steps(world, is_idle_skipped):
    """Returns the samples of a run with a target, with their ticks."""
    samples = []
    while world.clock.tick < TICKS:
        if world.clock.tick == PUSH_TICK:
            world.put("iiwa/target", PUSH)
        due = world.step()
        samples += [(world.clock.tick, world.clock.stamp_ns, repr(sample)) for sample in due]
        if is_idle_skipped:
            end = TICKS if world.clock.tick > PUSH_TICK else PUSH_TICK
            world.run_idle(end - world.clock.tick, math.inf)
    return samples


def test_idle_ticks_leave_the_world_as_steps_do(build):
    stepped, skipped = build(), build()
    assert _by_steps(skipped, True) == _by_steps(stepped, False)
    assert skipped.state_hash() == stepped.state_hash() and skipped.clock.tick == TICKS
    assert not skipped.pb.changes.unrecorded


def test_an_idle_tick_calls_nothing_but_physics_and_clocks(build, monkeypatch):
    monkeypatch.setattr("rpbi.world.world.IDLE_ROW_S", math.inf)  # else rows are short after an interruption
    world, calls = build(), Counter()
    world.step()

    def note(frame, event, function):
        calls[getattr(function, "__name__", "") if event == "c_call" else frame.f_code.co_name] += "call" in event

    sys.setprofile(note)
    try:
        ticks = world.run_idle(TICKS, math.inf)
    finally:
        sys.setprofile(None)
    assert ticks >= 10
    often = {name for name, count in calls.items() if count >= ticks}
    assert often <= {"stepSimulation"}


def test_an_input_ends_idle_ticks(build):
    world = build(joint_state_publisher_hz=0)
    step, done = world.pb.advance, []

    def physics():
        step()
        done.append(None)
        if len(done) == 100:
            world.put("iiwa/target", PUSH)

    world.pb.advance = physics
    world.step()
    world.run_idle(TICKS, math.inf)
    assert 100 <= len(done) <= 100 + MAX_IDLE_ROW


class Trembling(Robot):
    """Does something at every tick."""

    def before_step(self, tick):
        """Does what every robot does."""
        super().before_step(tick)


@pytest.mark.parametrize("busy", ["motion", "wrench", "velocity", "torque", "own class"])
def test_no_tick_is_idle_while_something_acts(build, busy):
    modes = {"velocity": "VELOCITY_CONTROL", "torque": "TORQUE_CONTROL"}
    mode = modes.get(busy, "POSITION_CONTROL")
    world = build(setJointMotorControlArray={"controlMode": mode})
    robot = world.bodies["iiwa"]
    if busy == "own class":
        robot.__class__ = Trembling
    elif busy == "wrench":
        world.act("ball", "push", {"force": (1.0, 0.0, 0.0)})
    elif busy == "motion":
        world.act("iiwa", "move", {"positions": PUSH, "duration_s": 1.0})
    else:
        world.put("iiwa/target", PUSH)
    world.step()
    assert world.run_idle(TICKS, math.inf) == 0
