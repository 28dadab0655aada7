"""Ticks, stamps and rates."""

import time

import pytest

from rpbi.engine.clock import Clock, Schedule


def test_simulated_stamps_are_exact_and_begin_at_one_tick():
    clock = Clock(0.001)
    assert clock.stamp_ns == 1_000_000
    for _ in range(123_456):
        clock.advance()
    assert clock.tick == 123_456
    assert clock.stamp_ns == 123_457 * 1_000_000
    assert clock.dt_s == 0.001


def test_time_step_is_rounded_once_to_whole_nanoseconds():
    clock = Clock(1.0 / 240.0)
    assert clock.dt_ns == 4_166_667
    clock.advance()
    assert clock.stamp_ns == 2 * 4_166_667


def test_wall_stamps_never_repeat_after_the_clock_is_set_back(monkeypatch):
    clock = Clock(0.001, simulated=False)
    first = clock.stamp_ns
    assert abs(first - time.time_ns()) < 10**10
    monkeypatch.setattr(time, "time_ns", lambda: first - 10**12)
    clock.advance()
    clock.restamp()
    assert clock.stamp_ns == first + 2


def test_simulated_stamps_do_not_change_within_a_tick():
    clock = Clock(0.01)
    clock.restamp()
    assert clock.stamp_ns == 10_000_000


def test_a_time_step_of_nothing_is_refused():
    with pytest.raises(ValueError, match="1e-10"):
        Clock(1e-10)


@pytest.mark.parametrize("hz", [1, 7, 30, 49.9, 50, 60, 333, 1000])
@pytest.mark.parametrize("dt_ns", [1_000_000, 4_166_667, 2_000_000])
def test_mean_rate_is_exact_with_a_jitter_of_one_tick(hz, dt_ns):
    schedule = Schedule(hz, dt_ns)
    ticks = 60 * 10**9 // dt_ns
    due = [tick for tick in range(1, ticks + 1) if schedule.is_due(tick)]
    rate = min(hz, 1e9 / dt_ns)
    assert abs(len(due) - ticks * dt_ns * 1e-9 * rate) <= 1
    gaps = {after - before for before, after in zip(due, due[1:])}
    assert max(gaps) - min(gaps) <= 1


@pytest.mark.parametrize("hz", [7, 30, 49.9, 1000, 5000])
def test_next_due_names_the_very_ticks_that_are_due(hz):
    schedule = Schedule(hz, 1_000_000)
    due = [tick for tick in range(1, 2000) if schedule.is_due(tick)]
    named, tick = [], 0
    while (tick := schedule.next_due(tick)) < 2000:
        named.append(tick)
    assert named == due


def test_a_rate_above_one_a_tick_is_clamped():
    schedule = Schedule(5000, 1_000_000)
    assert schedule.clamped
    assert all(schedule.is_due(tick) for tick in range(100))
    assert not Schedule(1000, 1_000_000).clamped


def test_tiny_rate_is_due_eventually():
    assert Schedule(1e-300, 1_000_000).next_due(0) == 10**9


def test_the_initial_state_is_due():
    assert Schedule(0.1, 1_000_000).is_due(0)


def test_span_of_ticks_is_due_if_one_of_them_is():
    schedule = Schedule(50, 1_000_000)
    assert schedule.is_due(25, since=15)
    assert not schedule.is_due(39, since=20)


@pytest.mark.parametrize("simulated", [True, False])
def test_restart_counts_from_zero_and_continues_the_stamps(simulated):
    clock = Clock(0.001, simulated)
    for _ in range(5):
        clock.advance()
    before_ns = clock.stamp_ns
    clock.restart()
    assert (clock.tick, clock.time_s) == (0, 0.0)
    assert clock.stamp_ns > before_ns
    if simulated:
        assert clock.stamp_ns == before_ns + clock.dt_ns


def test_stamps_within_a_tick_differ_and_later_ticks_keep_theirs() -> None:
    clock = Clock(0.001)
    clock.advance()
    for turn in range(1, 4):
        clock.bump_stamp()
        assert (clock.tick, clock.stamp_ns) == (1, 2_000_000 + turn)
    clock.advance()
    assert (clock.tick, clock.stamp_ns) == (2, 3_000_000)


def test_stamps_never_repeat_however_often_they_are_bumped() -> None:
    clock = Clock(1e-9)
    for _ in range(5):
        clock.bump_stamp()
    before = clock.stamp_ns
    clock.advance()
    assert clock.stamp_ns == before + 1
