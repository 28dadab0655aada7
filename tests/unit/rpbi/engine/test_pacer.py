"""Keeping step with the wall clock, with a clock that the test moves."""

import pytest

from rpbi.engine import pacer
from rpbi.engine.pacer import MAX_DEBT_S, Load, Pacer


@pytest.fixture
def wall(monkeypatch):
    class Wall:
        now_s = 100.0
        slept_s: list = []

        def monotonic(self):
            return self.now_s

        def sleep(self, duration_s):
            self.slept_s.append(duration_s)
            self.now_s += duration_s

    clock = Wall()
    clock.slept_s = []
    monkeypatch.setattr(pacer, "time", clock)
    return clock


def _run(pace, wall, until_s):
    ticks = 0
    while wall.now_s < until_s - 1e-9:
        ticks += pace.is_due()
        pace.wait()
    return ticks


@pytest.mark.parametrize(("factor", "expected"), [(1.0, 1000), (0.1, 100), (2.0, 2000)])
def test_ticks_follow_the_real_time_factor(wall, factor, expected):
    pace = Pacer(0.001, factor)
    assert _run(pace, wall, 101.0) == pytest.approx(expected, abs=1)
    assert pace.overruns == 0
    assert pace.measure() == pytest.approx(factor, rel=0.01)


def test_another_factor_counts_at_once_and_owes_nothing_of_before(wall):
    pace = Pacer(0.001)
    _run(pace, wall, 100.5)
    wall.now_s += 0.2
    pace.set_factor(0.1)
    assert _run(pace, wall, 101.7) == pytest.approx(100, abs=1)
    assert (pace.real_time_factor, pace.overruns) == (0.1, 0)
    assert pace.measure() == pytest.approx(0.1, rel=0.02)


def test_short_lateness_is_caught_up_with(wall):
    pace = Pacer(0.001)
    ticks = _run(pace, wall, 100.5)
    wall.now_s += 0.1
    ticks += _run(pace, wall, 101.0)
    assert ticks == pytest.approx(1000, abs=1)
    assert pace.overruns == pytest.approx(100, abs=2)
    assert pace.lost_s == 0.0


def test_long_lateness_is_given_up_and_counted(wall):
    pace = Pacer(0.001)
    pace.is_due()
    wall.now_s += MAX_DEBT_S + 2.0
    assert pace.is_due()
    assert not pace.is_due()
    assert pace.lost_s == pytest.approx(MAX_DEBT_S + 2.0, abs=0.002)


def test_free_running_is_always_due_and_never_sleeps(wall):
    pace = Pacer(0.001, 0.0)
    for _ in range(100):
        assert pace.is_due()
        pace.wait()
    assert wall.slept_s == []


def test_requests_are_looked_at_often_however_slow_the_motion(wall):
    pace = Pacer(0.02, 0.01)
    _run(pace, wall, 101.0)
    assert max(wall.slept_s) <= pacer.MAX_SLEEP_S


def test_a_start_after_a_stop_makes_nothing_up(wall):
    pace = Pacer(0.001)
    pace.is_due()
    wall.now_s += 60.0
    pace.restart()
    assert pace.is_due()
    assert not pace.is_due()
    assert pace.overruns == 0


@pytest.mark.parametrize(
    ("spent", "said"),
    [
        (Load(1.0, 0.4, 0.45, 0.3, 400), "the simulation got 40 % of a processor, since the machine is busy"),
        (Load(1.0, 0.4, 0.9, 0.3, 400), "got 40 % of a processor, other threads of the node 50 %"),
        (Load(1.0, 0.98, 1.0, 0.8, 400), "PyBullet takes 2 ms for a step of 1 ms"),
        (Load(1.0, 0.98, 1.0, 0.2, 400), "sensors, controllers and messages take 2 ms a tick, PyBullet 0.5 ms"),
    ],
)
def test_reason_names_the_part_that_slows_a_world_down(spent, said):
    assert said in spent.reason(0.001)
