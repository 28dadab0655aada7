"""Schedules of single targets: each test fails if one constant of the jitter buffer is changed."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from rpbi.control.jitter_buffer import JitterBuffer, Playout

DT_S = 0.001
PERIOD = 10
"""Interval of the targets [ticks]."""


def schedules(arrivals: Sequence[int], sent: Sequence[int], *, are_stamped: bool = False) -> list[Playout]:
    """Returns the playout of each target of a swing, given the ticks of its arrivals and of sending."""
    buffer = JitterBuffer(DT_S, 0.02)
    return [
        buffer.add(arrival, round((1.0 + tick * DT_S) * 1e9) if are_stamped else 0, {0: math.sin(0.01 * tick)})
        for arrival, tick in zip(arrivals, sent)
    ]


@pytest.mark.parametrize(("interval", "is_immediate"), [(1, True), (3, False)])
def test_only_targets_at_every_tick_act_at_once(interval: int, is_immediate: bool) -> None:
    ticks = range(0, 40 * interval, interval)
    playouts = schedules(ticks, ticks)
    assert {each.is_immediate for each in playouts[1:]} == {is_immediate}


def test_a_shorter_delay_is_taken_over_within_a_second() -> None:
    """All targets from the 200th on arrive one period sooner, as over a faster network."""
    changed = 200
    sent = range(0, (changed + 300) * PERIOD, PERIOD)
    ticks = [*sent[:changed], *(tick - PERIOD for tick in sent[changed:])]
    playouts = schedules(ticks, sent)
    assert max(each.speed for each in playouts[changed:]) < 1.05, "set points speed up only a little"
    delays = [playout.end - tick for playout, tick in zip(playouts, ticks)]
    assert delays[changed + 20] > delays[-1] + 0.5 * PERIOD, "not at once"
    assert delays[changed + 80] < delays[-1] + 0.1 * PERIOD, "but soon"


@pytest.mark.parametrize(("after", "replaces"), [(1, True), (5, False)], ids=["at once", "half a period later"])
def test_a_target_replaces_the_one_sent_just_before(after: int, replaces: bool) -> None:
    ticks = sorted([*range(0, 40 * PERIOD, PERIOD), 20 * PERIOD + after])
    playouts = schedules(ticks, ticks, are_stamped=True)
    before, new = playouts[20:22]
    assert new.start == pytest.approx(before.start if replaces else before.end)
