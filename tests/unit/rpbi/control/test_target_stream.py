"""Streams of position targets: when they are played, and what is between them."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

import pytest

from rpbi.control.jitter_buffer import JitterBuffer
from rpbi.control.stream_motion import BoundedMotion
from rpbi.control.target_stream import TargetStream

DT_S = 0.002
PERIOD = 10
"""Of the streams here [ticks]."""


def stamp_ns(tick: float) -> int:
    return round((1.0 + tick * DT_S) * 1e9)


def play(
    targets: Sequence[tuple[int, float, int]],
    ticks: int,
    *,
    smooth: bool = True,
    buffer_s: float = 0.0,
    velocities: Sequence[float] | None = None,
    limit: float = math.inf,
) -> list[float]:
    """Returns the set point after each tick of a joint at 0 that gets targets: tick, position, stamp."""

    def limited(index: int, value: float) -> float:
        return min(max(value, -limit), limit)

    stream = TargetStream(JitterBuffer(DT_S, buffer_s), {0: 0.0}, smooth, limited)
    waiting = list(enumerate(targets))
    positions = []
    for tick in range(ticks):
        while waiting and waiting[0][1][0] <= tick:
            number, (_, position, stamp) = waiting.pop(0)
            slopes = {} if velocities is None else {0: velocities[number] * DT_S}
            stream.push(tick, {0: position}, slopes, stamp)
        positions.append(stream.advance(tick + 1.0)[0])
    return positions


def largest_change_of_velocity(positions: Sequence[float]) -> float:
    """Returns the largest second difference, over the tick squared [rad/s^2]."""
    triples = zip(positions, positions[1:], positions[2:])
    return max(abs(a - 2.0 * b + c) for a, b, c in triples) / DT_S**2


def test_a_single_target_acts_at_the_next_tick():
    assert play([(5, 0.7, 0)], 8) == [0.0] * 5 + [0.7] * 3


def test_targets_far_apart_act_at_once():
    far = round(0.25 / DT_S)
    positions = play([(0, 0.1, 0), (far, 0.5, 0), (2 * far, 0.2, 0)], 2 * far + 1)
    assert set(positions) == {0.1, 0.5, 0.2}
    assert positions[far] == 0.5


def test_a_regular_stream_is_a_quadratic_b_spline():
    knots = [0.0, 0.0, 0.3, -0.2, 0.5, 0.4]
    positions = play([(number * PERIOD, knot, 0) for number, knot in enumerate(knots)], len(knots) * PERIOD)
    for number in range(2, len(knots)):
        before, at, after = knots[number - 2 : number + 1]
        for tick in range(PERIOD):
            u = (tick + 1) / PERIOD
            expected = 0.5 * (1 - u) ** 2 * before + (0.5 + u - u * u) * at + 0.5 * u * u * after
            assert positions[number * PERIOD + tick] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("smooth", [True, False], ids=["smooth", "linear"])
@pytest.mark.parametrize("seed", range(20))
def test_stream_stays_between_its_targets_and_ends_at_the_last(seed, smooth):
    rng = random.Random(seed)
    targets, tick, sent = [], 0, 0.0
    for _ in range(80):
        tick += rng.choice((0, 1, 3, 9, 10, 11, 30, 120))
        sent = max(sent + rng.uniform(-1.0, 20.0), tick - 15.0)
        targets.append((tick, rng.uniform(-1.0, 1.0), rng.choice((0, stamp_ns(sent), 17))))
    positions = play(targets, tick + 300, smooth=smooth)
    low = high = 0.0
    waiting = list(targets)
    for now, position in enumerate(positions):
        while waiting and waiting[0][0] <= now:
            low, high = min(low, waiting[0][1]), max(high, waiting[0][1])
            waiting.pop(0)
        assert low - 1e-12 <= position <= high + 1e-12
    assert positions[-1] == targets[-1][1]


def delayed(rng: random.Random, count: int) -> list[tuple[int, float, int]]:
    """Returns targets of constant velocity, some of which come up to four ticks too late."""
    return [
        (number * PERIOD + rng.choice((0, 0, 0, 1, 4)), 0.03 * number, stamp_ns(number * PERIOD))
        for number in range(count)
    ]


def test_buffer_evens_out_late_targets():
    targets = delayed(random.Random(3), 80)
    start = 40 * PERIOD
    by_stamps = play(targets, 80 * PERIOD, buffer_s=0.02)[start:]
    by_arrival = play([(tick, position, 0) for tick, position, _ in targets], 80 * PERIOD, buffer_s=0.02)[start:]
    without_buffer = play(targets, 80 * PERIOD)[start:]
    assert largest_change_of_velocity(by_stamps) < 1.0
    assert largest_change_of_velocity(by_arrival) < 1.0
    assert largest_change_of_velocity(without_buffer) > 5.0


@pytest.mark.parametrize("late", [9, 15], ids=["in the buffer", "beyond it"])
@pytest.mark.parametrize("has_stamps", [True, False], ids=["stamps", "no stamps"])
def test_one_late_target_does_not_change_a_constant_velocity(late, has_stamps):
    targets = [(n * PERIOD, 0.03 * n, stamp_ns(n * PERIOD) if has_stamps else 0) for n in range(60)]
    targets[40] = (40 * PERIOD + late, *targets[40][1:])
    targets[41] = (max(targets[40][0], targets[41][0]), *targets[41][1:])
    positions = play(targets, 58 * PERIOD, buffer_s=0.02)[20 * PERIOD :]
    assert largest_change_of_velocity(positions) < 1.0


def test_late_target_at_a_turning_point_stops_no_motion():
    def position(tick: float) -> float:
        return 0.8 * math.cos(math.pi * tick * DT_S)

    targets = [(n * PERIOD, position(n * PERIOD), 0) for n in range(120)]
    targets[101] = (targets[101][0] + 15, *targets[101][1:])
    targets[102] = (targets[101][0], *targets[102][1:])
    velocities = [(position(tick + 0.01) - position(tick - 0.01)) / (0.02 * DT_S) for tick in range(0, 1200, PERIOD)]
    positions = play(targets, 1150, buffer_s=0.02, velocities=velocities)[300:]
    assert largest_change_of_velocity(positions) < 1.05 * 0.8 * math.pi**2


def test_first_stall_of_a_regular_stream_changes_no_sample_times():
    """Its stamps are those of sending, and until then nothing says so."""
    turn = 2.0 * math.pi * PERIOD * DT_S
    positions = [0.3 * math.cos(turn * n) for n in range(120)]
    velocities = [-0.3 * 2.0 * math.pi * math.sin(turn * n) for n in range(120)]
    for stalled in range(70, 100):
        sent = [n * PERIOD for n in range(120)]
        sent[stalled] = sent[stalled + 1] = sent[stalled] + 15
        targets = [(tick, position, stamp_ns(tick)) for tick, position in zip(sent, positions)]
        swing = play(targets, 1150, buffer_s=0.02, velocities=velocities)[300:]
        assert largest_change_of_velocity(swing) < 1.5 * 0.3 * (2.0 * math.pi) ** 2


@pytest.mark.parametrize("stamps", ["of sending", "none"])
def test_jitter_adds_little_delay(stamps):
    for seed in range(16):
        rng, sent, targets = random.Random(seed), 0.0, []
        for number in range(250):
            sent = max(sent, number * PERIOD + rng.uniform(0.0, 6.0))
            targets.append((math.ceil(sent), 0.03 * number, stamp_ns(sent) if stamps == "of sending" else 0))
        positions = play(targets, 2480, buffer_s=0.02)
        lags = [tick + 1 - position * PERIOD / 0.03 for tick, position in enumerate(positions)][500:]
        assert sum(lags) / len(lags) * DT_S < 0.05


def test_the_delay_is_constant_from_the_first_target_on():
    """It is the buffer without the tick before which targets come, beside one and a half periods."""
    positions = play([(n * PERIOD, 0.03 * n, 0) for n in range(40)], 40 * PERIOD, buffer_s=0.02)
    lag = 1.5 * PERIOD + 0.02 / DT_S - 1.5
    for tick in range(4 * PERIOD, 40 * PERIOD):
        assert positions[tick] == pytest.approx(0.03 / PERIOD * (tick + 1 - lag), abs=1e-9)


def test_stream_stopped_at_full_speed_overshoots_a_little_and_returns():
    speed = 1.5
    for velocities, beyond_s in ((None, 0.091), ([speed] * 40, 0.101)):
        targets = [(n * PERIOD, speed * n * PERIOD * DT_S, 0) for n in range(40)]
        positions = play(targets, 70 * PERIOD, buffer_s=0.02, velocities=velocities)
        last = targets[-1][1]
        assert last + 0.7 * speed * beyond_s < max(positions) <= last + speed * beyond_s + 1e-9
        assert largest_change_of_velocity(positions[300:]) < 1.05 * speed / 0.15
        assert positions[-1] == last


@pytest.mark.parametrize("has_stamps", [True, False], ids=["stamps", "no stamps"])
def test_jitter_within_the_buffer_changes_nothing_of_a_swing(has_stamps, monkeypatch):
    """Targets are followed as without bounds of acceleration, since their own acceleration is below these."""
    rng, ticks, targets = random.Random(2), 0, []
    for n in range(200):
        ticks = max(ticks, n * PERIOD + rng.choice((0, 0, 2, 5)))
        targets.append((ticks, 0.5 * math.sin(0.08 * n) ** 3, stamp_ns(n * PERIOD) if has_stamps else 0))
    bounded = play(targets, 1980, buffer_s=0.02)
    monkeypatch.setattr(BoundedMotion, "advance", lambda self, planned: planned)
    assert bounded[300:] == pytest.approx(play(targets, 1980, buffer_s=0.02)[300:], abs=1e-4)


def test_first_target_after_a_stall_does_not_jump():
    for pause, jumps in ((300, False), (600, True)):
        ticks = [n * PERIOD + (pause if n >= 40 else 0) for n in range(41)]
        positions = play([(tick, 0.003 * tick, 0) for tick in ticks], ticks[-1] + 20, buffer_s=0.02)
        assert (largest_change_of_velocity(positions[350:]) > 100.0) is jumps


def test_a_burst_after_a_stall_is_no_change_of_period():
    buffer = JitterBuffer(DT_S, 0.02)
    ticks = [450 if 40 <= n < 45 else n * PERIOD for n in range(60)]
    periods = [buffer.add(tick, 0, {0: 0.03 * n}).period for n, tick in enumerate(ticks)]
    assert periods[10:] == pytest.approx([PERIOD] * 50, rel=0.05)


def test_a_lost_target_leaves_no_gap():
    targets = [(n * PERIOD, 0.03 * n, 0) for n in range(60) if n != 40]
    positions = play(targets, 58 * PERIOD, buffer_s=0.02)[20 * PERIOD :]
    assert largest_change_of_velocity(positions) < 10.0


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_stream_may_change_its_period(factor):
    ticks = [n * PERIOD for n in range(40)]
    ticks += [ticks[-1] + round(factor * PERIOD * (n + 1)) for n in range(160)]
    positions = play([(tick, 0.003 * tick, 0) for tick in ticks], ticks[-1], buffer_s=0.02)
    lag = (1.5 * factor * PERIOD + 0.02 / DT_S - 1.5) * 0.003
    assert positions[-1] == pytest.approx(0.003 * ticks[-1] - lag, abs=0.5 * PERIOD * 0.003)


@pytest.mark.parametrize("jump_s", [-1000.0, 0.05, 1000.0])
def test_a_clock_may_jump(jump_s):
    """After the jump, arrivals count until some stamps are of the new clock."""
    stamps = [stamp_ns(n * PERIOD) + (round(1e9 * (jump_s + 1000.0)) if n >= 40 else 10**12) for n in range(100)]
    positions = play([(n * PERIOD, 0.03 * n, stamps[n]) for n in range(100)], 98 * PERIOD, buffer_s=0.02)
    assert largest_change_of_velocity(positions[20 * PERIOD :]) < 0.6 * 1.5 / (PERIOD * DT_S)  # of a full stop
    lag = 1.5 * PERIOD + 0.02 / DT_S - 1.5
    assert positions[-1] == pytest.approx(0.003 * (98 * PERIOD - lag), abs=0.09)


@pytest.mark.parametrize("stalled", ["world", "sender"])
@pytest.mark.parametrize("stall_s", [0.15, 0.3, 0.9])
def test_targets_queued_in_a_stall_are_played_slightly_faster(stalled, stall_s):
    stall, begin, speed = round(stall_s / DT_S), 80 * PERIOD, 0.003
    if stalled == "world":  # its ticks do not go on meanwhile
        arrivals = [n * PERIOD if n <= 80 else max(begin + 1, n * PERIOD - stall) for n in range(400)]
    else:
        arrivals = [max(n * PERIOD, begin + stall) if n > 80 else n * PERIOD for n in range(400)]
    targets = [(tick, speed * n * PERIOD, stamp_ns(n * PERIOD)) for n, tick in enumerate(arrivals)]
    positions = play(targets, arrivals[-1], buffer_s=0.02)
    jump = 0 if stalled == "world" else begin + stall  # the first target after a pause acts at once
    fastest = max(
        after - before
        for tick, (before, after) in enumerate(zip(positions, positions[1:]))
        if tick > begin and tick + 1 != jump
    )
    assert fastest < 1.4 * speed, "a jump would push what the robot touches away"
    lag = 1.5 * PERIOD + 0.02 / DT_S - 1.5
    assert positions[-1] == pytest.approx(targets[-1][1] - lag * speed, abs=2 * PERIOD * speed)


def test_slower_world_lags_behind_the_senders_clock_only_temporarily():
    arrivals = [n * PERIOD for n in range(100)]
    arrivals += [arrivals[-1] + round(PERIOD / 3 * (n + 1)) for n in range(1300)]
    targets = [(tick, 0.03 * n, stamp_ns(n * PERIOD)) for n, tick in enumerate(arrivals)]
    positions = play(targets, arrivals[-1], buffer_s=0.02)
    lags = [number - positions[tick - 1] / 0.03 for number, tick in enumerate(arrivals)]
    assert max(lags) < 200 and max(lags[-10:]) < 10


@pytest.mark.parametrize("seed", range(20))
def test_slow_world_never_jumps_to_the_newest_target_of_bursts(seed):
    """As on a busy machine: targets that wait are played, also once the clock of the stamps counts as another one."""
    rng, speed, burst, targets = random.Random(seed), 0.003, 0, []
    for n in range(600):
        tick = n * PERIOD if n < 100 else 100 * PERIOD + round(0.6 * PERIOD * (n - 100))
        if tick > burst and n >= 100:
            burst = tick + rng.choice((0, 0, 8, 20, 60, 90))
        targets.append((max(tick, burst), speed * n * PERIOD, stamp_ns(n * PERIOD)))
    positions = play(targets, targets[-1][0] + 800, buffer_s=0.1)
    largest = max(abs(after - before) for before, after in zip(positions[500:], positions[501:]))
    assert largest < 100.0 * speed, "a burst, but not the whole rest, which is 300 to 400 ticks"
    assert max(positions) - targets[-1][1] < 1.0 and positions[-1] == targets[-1][1]


@pytest.mark.parametrize(
    "stamp",
    [lambda n: 0, lambda n: stamp_ns(0), lambda n: stamp_ns(-n * PERIOD), lambda n: stamp_ns(3 * n * PERIOD)],
    ids=["none", "the same", "backwards", "another clock"],
)
def test_stamps_that_make_no_sense_do_not_count(stamp):
    ticks = 60 * PERIOD
    expected = play([(n * PERIOD, 0.03 * n, stamp_ns(n * PERIOD)) for n in range(60)], ticks)
    positions = play([(n * PERIOD, 0.03 * n, stamp(n)) for n in range(60)], ticks)
    assert positions[-PERIOD:] == pytest.approx(expected[-PERIOD:], abs=0.03)


def test_targets_at_every_tick_are_not_delayed():
    positions = play([(tick, 0.01 * tick, 0) for tick in range(50)], 50)
    assert positions == [0.01 * tick for tick in range(50)]


def test_velocities_make_it_a_cubic_that_lags_by_one_period():
    def position(tick: float) -> float:
        return 1e-8 * tick**3 - 2e-6 * tick**2 + 1e-4 * tick

    def velocity(tick: float) -> float:
        return (3e-8 * tick**2 - 4e-6 * tick + 1e-4) / DT_S

    ticks = [number * PERIOD for number in range(20)]
    positions = play([(tick, position(tick), 0) for tick in ticks], 200, velocities=[velocity(tick) for tick in ticks])
    for tick in range(2 * PERIOD, 200):
        assert positions[tick] == pytest.approx(position(tick + 1 - PERIOD), abs=1e-12)


def test_velocities_that_do_not_fit_do_not_count():
    targets = [(number * PERIOD, 0.03 * number, 0) for number in range(20)]
    assert play(targets, 250, velocities=[0.0] * 20) == play(targets, 250)


def test_hostile_velocities_pass_no_limit():
    rng = random.Random(1)
    targets = [(number * PERIOD, rng.choice((-0.5, 0.4, 0.5)), 0) for number in range(100)]
    velocities = [rng.uniform(-10.0, 10.0) for _ in targets]
    assert max(map(abs, play(targets, 1100, velocities=velocities, buffer_s=0.02))) > 0.51
    assert max(map(abs, play(targets, 1100, velocities=velocities, buffer_s=0.02, limit=0.5))) <= 0.5


def test_motion_off_its_plan_returns_to_slow_targets():
    motion = BoundedMotion({0: 0.0}, DT_S, True, lambda index, value: value)
    tick = 0

    def follow(way: float, planned: float) -> float:
        """Returns the set point at the end of the period of a target."""
        nonlocal tick
        motion.is_under_way(tick)
        motion.add({0: way}, PERIOD, PERIOD)
        tick += PERIOD
        return [motion.advance({0: planned})[0] for _ in range(PERIOD)][-1]

    for number in range(20):
        follow(0.001 * (-1) ** number, 0.0)
    motion.jump({0: 0.05})
    positions = [follow(1e-6 * (-1) ** number, 0.05) for number in range(50)]
    assert positions[-1] == pytest.approx(0.05, abs=1e-6)
