"""What a guard commands after it has halted in the middle of a motion: nothing, or the braking that it knows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from guarded_arm import LIMITS, PERIOD_S, BrokenCheck, decide, guard_of, slider, worst_shares

from safe_robot.check import CheckContext
from safe_robot.guard import Guard

ROUNDING = 1e-6
"""Relative, of differences."""


def refuse(guard: Guard) -> None:
    assert decide(guard, (0.5, 0.5)).is_halted


def nonsense(guard: Guard) -> None:
    assert decide(guard, (math.nan, 0.0)).is_halted


def stale(guard: Guard) -> None:
    assert guard.check_watchdogs(CheckContext(since_command_s=1.0)) is not None


def fail(guard: Guard) -> None:
    with broken(guard):
        decide(guard, guard.last_command)


def fail_later(guard: Guard) -> None:
    with broken(guard):
        guard.check_watchdogs(CheckContext())


@contextmanager
def broken(guard: Guard) -> Iterator[None]:
    guard.checks = [BrokenCheck(None, None, None, ""), *guard.checks]
    with pytest.raises(ZeroDivisionError):
        yield
    guard.checks = guard.checks[1:]


def in_motion(tmp_path, **config) -> tuple[Guard, list[tuple[float, ...]]]:
    """Returns a guard in the middle of a motion, and its commands."""
    guard = guard_of(slider(tmp_path), **config)
    targets = [(0.3 * math.sin(2.0 * t) * min(t, 1.0) ** 3, -0.2 * t**3) for t in np.arange(0.0, 0.7, PERIOD_S)]
    return guard, [decide(guard, target).command for target in targets]


HALTS = (refuse, nonsense, stale, fail, fail_later, Guard.halt)


@pytest.mark.parametrize("halt", HALTS, ids=lambda halt: halt.__name__)
def test_any_halt_follows_the_verified_braking_and_ends_at_rest(tmp_path, halt):
    guard, commands = in_motion(tmp_path, on_halt="brake", start_tolerance=0.01)
    known = guard.stop_commands
    assert len(known) > 10 and not guard.is_braking and guard.next_braking() is None
    halt(guard)
    assert guard.is_halted and guard.is_braking
    assert decide(guard, commands[-1]).command is None, "a target is followed no more"
    with pytest.raises(RuntimeError, match="still brakes"):
        guard.start()
    braking = list(iter(guard.next_braking, None))
    assert np.array_equal(braking, known)
    assert max(worst_shares([*commands, *braking], LIMITS, PERIOD_S).values()) <= 1.0 + ROUNDING
    assert not guard.is_braking and guard.last_command == braking[-1]
    guard.start()
    assert decide(guard, commands[-1]).violation.check == "start", "the robot is where it rests"
    guard.start()
    assert decide(guard, braking[-1]).violation is None


@pytest.mark.parametrize("halt", HALTS, ids=lambda halt: halt.__name__)
def test_by_default_nothing_follows(tmp_path, halt):
    guard, commands = in_motion(tmp_path)
    halt(guard)
    assert guard.is_halted and not guard.is_braking and guard.next_braking() is None
    assert guard.last_command == commands[-1] and not len(guard.stop_commands)


def test_robot_at_rest_receives_no_command(tmp_path):
    guard = guard_of(slider(tmp_path), on_halt="brake")
    for _ in range(3):
        decide(guard, (0.1, 0.0))
    guard.halt()
    assert not guard.is_braking and guard.next_braking() is None


def test_a_braking_that_cannot_be_sent_ends(tmp_path):
    guard, _ = in_motion(tmp_path, on_halt="brake")
    guard.halt()
    first = guard.next_braking()
    guard.rest()
    assert guard.next_braking() is None and guard.last_command == first
