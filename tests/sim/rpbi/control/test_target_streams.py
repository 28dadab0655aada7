"""Robots that follow streams of position targets."""

from __future__ import annotations

import math
import random
from collections import deque
from pathlib import Path

import numpy as np
import pytest
from worlds import iiwa, write_world

from rpbi.control.joint_command import JointCommand
from rpbi.control.stream_motion import BoundedMotion
from rpbi.world import World

FIRST, SECOND = "lbr_iiwa_joint_1", "lbr_iiwa_joint_2"
DT_S = 0.002
EVERY = 10
"""Ticks between two targets of a stream at 50 Hz."""
TICKS = 1500
BUFFER_S = 0.02 - 1.5 * DT_S
"""Delay by the jitter buffer, which counts one and a half ticks for itself."""


def swing(time_s: float) -> float:
    return 0.8 * math.sin(2.0 * math.pi * 0.3 * time_s)


def swing_velocity(time_s: float) -> float:
    return 0.8 * 2.0 * math.pi * 0.3 * math.cos(2.0 * math.pi * 0.3 * time_s)


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(interpolation: str | None = None, **more) -> World:
        keys = {} if interpolation is None else {"target_interpolation": interpolation}
        world = World.from_file(write_world(tmp_path, robots=(iiwa(**keys, **more),), timeStep=DT_S))
        worlds.append(world)
        return world

    yield build_world
    for world in worlds:
        world.close()


def follow(world: World, every: int, velocities: bool = False) -> np.ndarray:
    """Has the first joint follow targets; returns position [rad], velocity [rad/s] and effort [N m] by tick."""
    arm = world.bodies["iiwa"]
    states = []
    for tick in range(TICKS):
        if tick % every == 0:
            time_s = tick * DT_S
            velocity = [swing_velocity(time_s)] if velocities else []
            stamp_ns = round(1e9 * (1.0 + time_s))
            world.put("iiwa/target", JointCommand([FIRST], [swing(time_s)], velocity, stamp_ns=stamp_ns))
        world.step()
        states.append([arm.pb.getJointState(arm.body_id, arm.model[FIRST].index)[index] for index in (0, 1, 3)])
    return np.array(states)[300:]


def test_stream_needs_no_more_effort_than_targets_at_every_tick(build):
    ideal = np.abs(follow(build(), 1)[:, 2]).max()
    smooth, hold = (np.abs(follow(build(mode), EVERY)[:, 2]).max() for mode in ("smooth", "hold"))
    assert smooth < 1.3 * ideal
    assert hold > 5.0 * ideal


@pytest.mark.parametrize(
    "mode, lag_s", [("smooth", 1.5 * EVERY * DT_S + BUFFER_S), ("linear", EVERY * DT_S + BUFFER_S)]
)
def test_a_stream_is_followed_with_a_known_lag(build, mode, lag_s):
    position, velocity, _ = follow(build(mode), EVERY).T
    times_s = (np.arange(300, TICKS) + 1) * DT_S - lag_s
    assert position == pytest.approx([swing(each) for each in times_s], abs=2e-3)
    ripple = velocity - [swing_velocity(each - DT_S / 2.0) for each in times_s]
    assert np.sqrt(np.mean(ripple**2)) < (0.01 if mode == "smooth" else 0.04)


def test_velocities_are_fed_forward(build):
    """A stream that tells them lags by one period, targets at every tick do not lag at all."""
    times_s = (np.arange(300, TICKS) + 1) * DT_S
    for every, lag_s in ((EVERY, EVERY * DT_S + BUFFER_S), (1, DT_S)):
        position = follow(build(), every, velocities=True)[:, 0]
        assert position == pytest.approx([swing(each - lag_s) for each in times_s], abs=1e-3)
    without = follow(build(), 1)[:, 0]
    assert np.abs(without - [swing(each) for each in times_s]).max() > 0.02


def jittery(rng: random.Random, stamps: str, jitter_s: float, stall_s: float = 0.0) -> list[tuple[float, float, int]]:
    """Returns arrival [s], time of the sample [s] and stamp [ns] of targets at 50 Hz, one of them with a stall."""
    targets, latest_s = [], 0.0
    for number in range(round(TICKS / EVERY)):
        sample_s = number * EVERY * DT_S
        late_s = stall_s if stall_s and number == 100 else rng.uniform(0.0, jitter_s)
        latest_s = max(latest_s, sample_s + late_s)
        stamp_s = {"sample": sample_s, "sending": latest_s, "none": -1.0}[stamps]
        targets.append((latest_s, sample_s, round(1e9 * (1.0 + stamp_s))))
    return targets


def follow_jittery(world: World, targets: list[tuple[float, float, int]], velocities: bool) -> tuple[float, float]:
    """Returns the largest effort [N m] of the first joint and its mean lag [s]."""
    arm = world.bodies["iiwa"]
    index, waiting, states = arm.model[FIRST].index, deque(targets), []
    for tick in range(TICKS):
        while waiting and waiting[0][0] <= tick * DT_S + 1e-9:
            _, sample_s, stamp_ns = waiting.popleft()
            velocity = [swing_velocity(sample_s)] if velocities else []
            world.put("iiwa/target", JointCommand([FIRST], [swing(sample_s)], velocity, stamp_ns=stamp_ns))
        world.step()
        position, _, _, effort = arm.pb.getJointState(arm.body_id, index)
        time_s = (tick + 1) * DT_S
        states.append((position - swing(time_s), swing_velocity(time_s), effort))
    error, velocity, effort = np.array(states)[400:].T
    return float(np.abs(effort).max()), float(-(error @ velocity) / (velocity @ velocity))


@pytest.mark.parametrize(
    "stamps, velocities", [("sample", False), ("sending", False), ("sending", True), ("none", False)]
)
def test_jitter_costs_little_effort_and_lag(build, stamps, velocities):
    ideal = np.abs(follow(build(), 1, velocities)[100:, 2]).max()
    effort, lag_s = follow_jittery(build(), jittery(random.Random(7), stamps, 0.012), velocities)
    assert effort < 1.2 * ideal
    assert lag_s < 0.051


@pytest.mark.parametrize("velocities", [False, True])
def test_a_stall_costs_little_effort(build, velocities):
    ideal = np.abs(follow(build(), 1, velocities)[100:, 2]).max()
    effort, _ = follow_jittery(build(), jittery(random.Random(0), "sending", 0.0, 0.03), velocities)
    assert effort < 1.5 * ideal


def lift(time_s: float) -> float:
    """Returns the position of the second joint, which carries the arm, in a swing that grows for a second."""
    share = min(time_s, 1.0)
    return 0.49 * share**3 * (10.0 - 15.0 * share + 6.0 * share**2) * math.sin(math.pi * time_s)


def lift_effort(world: World, targets: list[tuple[int, float, int]]) -> float:
    """Returns the largest effort [N m] of the second joint by targets: tick, position [rad], stamp [ns]."""
    arm = world.bodies["iiwa"]
    index, waiting, efforts = arm.model[SECOND].index, deque(targets), []
    for tick in range(targets[-1][0]):
        while waiting[0][0] <= tick:
            _, position, stamp_ns = waiting.popleft()
            world.put("iiwa/target", JointCommand([SECOND], [position], stamp_ns=stamp_ns))
        world.step()
        efforts.append(abs(arm.pb.getJointState(arm.body_id, index)[3]))
    return max(efforts[500:])


def ideal_lift_effort(world: World) -> float:
    """Returns the largest effort [N m] of the second joint by targets at every tick."""
    every = [(tick, lift(DT_S * tick), round(1e9 * (1.0 + DT_S * tick))) for tick in range(TICKS)]
    return lift_effort(world, every)


@pytest.mark.parametrize("stamps", ["sending", "sample", "none"])
@pytest.mark.parametrize("name", ["busy_machine", "stalls"])
def test_arrivals_on_a_busy_machine_cost_little_effort(build, name, stamps):
    """The arrivals were recorded: 50 targets a second.

    Those of `busy_machine` are up to 80 ms late; their sender had little priority. Those of `stalls` came in time for
    3.6 s, then 86 and 68 ms late, beside five busy loops and the work of others.
    """
    arrivals = np.loadtxt(Path(__file__).with_name(f"{name}.csv"), int, delimiter=",", skiprows=1).tolist()
    stamp_ns = {
        "sending": lambda number, sent_us: 1000 * (sent_us + 10**6),
        "sample": lambda number, sent_us: 20_000_000 * number + 10**9,
        "none": lambda number, sent_us: 0,
    }[stamps]
    late = [(tick, lift(0.02 * n), stamp_ns(n, sent_us)) for n, (tick, sent_us) in enumerate(arrivals)]
    assert lift_effort(build(), late) < 1.5 * ideal_lift_effort(build())


def stalled(stall_s: float, has_stamps: bool, waits: bool = True) -> list[tuple[int, float, int]]:
    """Returns targets at 50 Hz with a stall at the largest velocity: tick, position [rad], stamp [ns].

    Targets that wait come at once after it; others are never sent.
    """
    first, last, targets = 1000, 1000 + round(stall_s / DT_S), []
    for number in range(150):
        sample = EVERY * number
        tick = last if first <= sample < last else sample
        if waits or tick == sample:
            targets.append((tick, lift(DT_S * sample), 2_000_000 * sample + 10**9 if has_stamps else 0))
    return targets


@pytest.mark.parametrize("waits", [True, False], ids=["come at once", "are lost"])
@pytest.mark.parametrize("has_stamps", [True, False], ids=["stamps", "no stamps"])
@pytest.mark.parametrize("stall_s", [0.05, 0.1, 0.18, 0.4, 0.8])
def test_stall_longer_than_the_buffer_costs_little_effort(build, stall_s, has_stamps, waits):
    assert lift_effort(build(), stalled(stall_s, has_stamps, waits)) < 1.5 * ideal_lift_effort(build())


def test_without_bounds_of_acceleration_a_stall_costs_the_whole_effort(build, monkeypatch):
    monkeypatch.setattr(BoundedMotion, "advance", lambda self, planned: planned)
    assert lift_effort(build(), stalled(0.1, has_stamps=True)) > 4.0 * ideal_lift_effort(build())


def test_stream_slowed_by_late_targets_is_reported_once(build, caplog):
    late = [20, 15, 25]
    targets = [(10 * n + (late[n // 100] if n in (100, 200, 299) else 0), 0.003 * n, 0) for n in range(300)]
    lift_effort(build(), [*targets, (3100, 0.9, 0)])
    warnings = [record.getMessage() for record in caplog.records if "late" in record.getMessage()]
    assert len(warnings) == 1 and "iiwa: a target came " in warnings[0]
    assert "ms too late, so that the motion slowed down; target_buffer_s is 20 ms" in warnings[0]


def test_a_single_target_acts_at_the_next_tick(build):
    world = build()
    arm = world.bodies["iiwa"]
    index = arm.model[FIRST].index
    world.put("iiwa/target", JointCommand([FIRST], [0.3]))
    world.step()
    assert arm.motors.targets[index] == 0.3
    assert arm.drive.measured()[index][0] > 0.01


def test_targets_beyond_a_limit_go_to_the_limit(build):
    world = build()
    arm = world.bodies["iiwa"]
    upper = arm.model[FIRST].upper
    for number in range(40):
        world.put("iiwa/target", JointCommand([FIRST], [0.1 * number], [5.0]))
        for _ in range(EVERY):
            world.step()
            assert arm.motors.targets[arm.model[FIRST].index] <= upper
    assert arm.drive.measured()[arm.model[FIRST].index][0] == pytest.approx(upper, abs=1e-3)


def test_joint_reset_ends_a_stream_and_other_joints_hold(build):
    """Put elsewhere in the middle of a stream, a joint stays there; others of the stream hold."""
    world = build()
    arm = world.bodies["iiwa"]
    second = "lbr_iiwa_joint_2"
    for number in range(8):
        world.put("iiwa/target", JointCommand([FIRST, second], [0.02 * number] * 2))
        for _ in range(EVERY):
            world.step()
    world.act("iiwa", "set_joint_state", JointCommand([FIRST], [-0.5]))
    held = arm.motors.targets[arm.model[second].index]
    for _ in range(200):
        world.step()
    measured = arm.drive.measured()
    assert measured[arm.model[FIRST].index][0] == pytest.approx(-0.5, abs=1e-3)
    assert measured[arm.model[second].index][0] == pytest.approx(held, abs=1e-3)
    assert 0.1 < held < 0.14


def test_targets_received_while_paused_act_after_the_pause(build):
    world = build()
    for number in range(500):
        world.put("iiwa/target", JointCommand([FIRST], [0.001 * number], stamp_ns=1 + number * 20_000_000))
        world.apply_inputs()
    world.step()
    assert world.bodies["iiwa"].motors.targets[world.bodies["iiwa"].model[FIRST].index] == pytest.approx(0.499)
