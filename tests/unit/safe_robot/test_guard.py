"""What the guard lets pass, what it does instead, and what an oracle from outside says of its commands."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest
from guarded_arm import HOME, KUKA, LIMITS, PERIOD_S, decide, folding, guard_of, slider, worst_shares

from custom_ros_tools.errors import ConfigError
from safe_robot.check import Check, Situation, Violation
from safe_robot.geometry.distances import LinkDistances
from safe_robot.robot import GuardedRobot

FUZZ = "GUARD_FUZZ_TARGETS"
"""Environment variable: how many adversarial targets to try for each policy."""
ROUNDING = 1e-6
"""Relative, of the oracle's differences."""


def smooth(robot, seconds: float, amplitude: float = 0.3, at: tuple[float, ...] = ()):
    """Yields targets of a motion within limits of speed, acceleration and jerk."""
    start = np.array(at or [0.0] * len(robot.joint_names))
    for k in range(round(seconds / PERIOD_S)):
        t = k * PERIOD_S
        ramp = min(t, 1.0) ** 3 * (10.0 - 15.0 * min(t, 1.0) + 6.0 * min(t, 1.0) ** 2)
        yield tuple((start + amplitude * ramp * math.sin(1.5 * t)).tolist())


@pytest.mark.parametrize("policy", ["reject", "limit"])
def test_safe_targets_pass_to_the_last_bit(policy):
    robot = GuardedRobot(KUKA)
    guard = guard_of(robot, policy=policy)
    for target in smooth(robot, 3.0, at=HOME):
        decision = decide(guard, target)
        assert decision == (target, None, False)


def test_reject_sends_nothing_from_the_first_unsafe_target_on_until_it_is_started(tmp_path):
    guard = guard_of(slider(tmp_path))
    assert decide(guard, (0.0, 0.0)).command == (0.0, 0.0)
    decision = decide(guard, (0.1, 0.0))
    assert decision.command is None and decision.is_halted
    assert decision.violation == Violation("joint_velocity", "joint 'slide'", pytest.approx(10.0), 0.95, "m/s")
    assert str(decision.violation) == "joint_velocity: joint 'slide' would have 10 m/s; the limit is 0.95"
    assert decide(guard, (0.0, 0.0)) == (None, None, True)
    guard.start()
    assert decide(guard, (0.0, 0.0)).command == (0.0, 0.0)


def test_before_a_limit_of_position_only_speeds_that_can_be_braked_pass(tmp_path):
    """The same speed is safe in the middle and not near the limit, though the target is within all limits."""
    robot = slider(tmp_path)
    guard = guard_of(robot)
    targets = [(0.62 + x, 0.0) for x, _ in smooth(robot, 3.0, 0.45)]
    decisions = [decide(guard, target) for target in targets]
    first = next(i for i, decision in enumerate(decisions) if decision.command is None)
    violation = decisions[first].violation
    assert violation.check == "joint_position" and violation.is_while_braking and violation.limit == 1.0
    assert 0.9 < targets[first][0] < 1.0


def test_what_cannot_be_braked_is_not_safe_whatever_the_checks_say(tmp_path):
    off = {"active": False}
    guard = guard_of(slider(tmp_path), checks={"joint_acceleration": off, "joint_jerk": off})
    decide(guard, (0.0, 0.0))
    decision = decide(guard, (0.0, 0.005))
    assert decision.command is None and decision.is_halted
    assert decision.violation[:2] == ("braking", "joint 'turn'") and decision.violation.is_while_braking


@pytest.mark.parametrize("bad", [(math.nan, 0.0), (0.0, math.inf), (0.0,), (0.0, 0.0, 0.0), ()])
def test_targets_that_are_no_targets_are_refused(tmp_path, bad):
    guard = guard_of(slider(tmp_path))
    decide(guard, (0.0, 0.0))
    decision = decide(guard, bad)
    assert decision.command is None and decision.is_halted and decision.violation.check == "input"


def test_an_exception_in_a_check_stops_everything(tmp_path):
    class Broken(Check):
        name = "broken"

        def check(self, motion, situation):
            raise ZeroDivisionError

    guard = guard_of(slider(tmp_path))
    guard.checks = [Broken(None, None, None, ""), *guard.checks]
    with pytest.raises(ZeroDivisionError):
        decide(guard, (0.0, 0.0))
    assert guard.is_halted and decide(guard, (0.0, 0.0)).command is None


class TestStart:
    """The first target after a start."""

    def test_without_measured_positions_it_waits(self, tmp_path):
        guard = guard_of(slider(tmp_path), start_from="measured")
        decision = decide(guard, (0.0, 0.0))
        assert decision.command is None and not decision.is_halted and decision.violation.check == "start"
        assert decide(guard, (0.0, 0.0), measured={"slide": 0.01, "turn": 0.0}).command == (0.0, 0.0)

    def test_measured_positions_of_other_joints_are_none(self, tmp_path):
        guard = guard_of(slider(tmp_path), start_from="measured")
        assert decide(guard, (0.0, 0.0), measured={"slide": 0.0, "other": 0.0}).command is None

    def test_a_jump_from_the_measured_position_is_refused(self, tmp_path):
        guard = guard_of(slider(tmp_path))
        decision = decide(guard, (0.0, 0.0), measured={"slide": 0.0, "turn": 0.06})
        assert decision.is_halted and decision.violation[:2] == ("start", "joint 'turn'")

    def test_a_jump_from_the_last_command_is_refused(self, tmp_path):
        guard = guard_of(slider(tmp_path))
        decide(guard, (0.0, 0.0))
        guard.halt()
        guard.start()
        assert decide(guard, (0.3, 0.0)).violation.check == "start"

    def test_a_robot_outside_its_limits_may_only_come_in(self, tmp_path):
        for first, is_safe in ((1.21, False), (1.2, True), (1.19, True)):
            guard = guard_of(slider(tmp_path))
            decision = decide(guard, (first, 0.0), measured={"slide": 1.2, "turn": 0.0})
            assert (decision.command is not None) == is_safe, first


def test_it_says_when_targets_fail_to_come_while_the_robot_moves_and_only_then(tmp_path):
    robot = slider(tmp_path)
    guard = guard_of(robot)
    targets = list(smooth(robot, 1.0))
    decide(guard, targets[0])
    assert guard.late(Situation(since_command_s=10.0)) is None
    for target in targets[1:50]:
        assert decide(guard, target).violation is None
    assert guard.late(Situation(since_command_s=0.09)) is None
    assert guard.late(Situation(since_command_s=0.11)).check == "staleness"
    assert guard.is_halted


class TestLimitPolicy:
    """Something safe in the place of what is not."""

    def test_a_far_target_is_reached_within_limits_and_not_passed(self, tmp_path):
        guard = guard_of(slider(tmp_path), policy="limit")
        decide(guard, (0.0, 0.0))
        commands = [decide(guard, (0.8, -1.0)).command for _ in range(400)]
        assert max(worst_shares([(0.0, 0.0), *commands], LIMITS, PERIOD_S).values()) <= 1.0 + ROUNDING
        assert commands[-1] == pytest.approx((0.8, -1.0), abs=1e-3)
        assert max(x for x, _ in commands) <= 0.8 + 1e-9 and min(a for _, a in commands) >= -1.0 - 1e-9

    def test_a_target_beyond_a_limit_is_followed_to_the_limit(self, tmp_path):
        guard = guard_of(slider(tmp_path), policy="limit")
        decide(guard, (0.0, 0.0))
        commands = [decide(guard, (5.0, 0.0)).command for _ in range(400)]
        assert commands[-1][0] == pytest.approx(1.0, abs=5e-3) and max(x for x, _ in commands) <= 1.0

    def test_what_is_no_target_brakes_the_robot(self, tmp_path):
        robot = slider(tmp_path)
        guard = guard_of(robot, policy="limit")
        commands = [decide(guard, target).command for target in list(smooth(robot, 1.0))[:60]]
        commands += [decide(guard, (math.nan, 0.0)).command for _ in range(100)]
        assert max(worst_shares(commands, LIMITS, PERIOD_S).values()) <= 1.0 + ROUNDING
        assert commands[-1] == commands[-2] and not guard.is_moving

    def test_away_from_what_is_near_it_may_be_fast(self, tmp_path):
        """Out of the margin of a self-collision, the speed is that of anywhere."""
        robot = folding(tmp_path)
        limits = {**LIMITS, "velocity_factor": 1.0}
        start = (0.0, 2.60)
        guard = guard_of(robot, policy="limit", limits=limits, checks={"self_collision": {"margin_m": 0.1}})
        assert decide(guard, start).command == start
        commands = [start, *(decide(guard, (0.0, 0.0)).command for _ in range(150))]
        speed = np.abs(np.diff(np.array(commands)[:, 1])) / PERIOD_S
        assert speed.max() >= 0.95 * LIMITS["velocity"]


def adversary(generator: np.random.Generator, count: int, n: int):
    """Yields targets of every bad kind, between them ordinary ones: the next is given what was commanded last."""
    at, velocity, far, stay = np.zeros(n), np.zeros(n), np.zeros(n), 0
    for _ in range(count):
        kind = generator.integers(0, 20)
        last = yield tuple(at.tolist())
        at, stay = np.array(last), stay - 1
        if stay > 0:
            at = far
        elif kind == 0:
            at = far = generator.uniform(-4.0, 4.0, n)
            stay = generator.choice((1, 10, 300))
        elif kind == 1:
            at = np.where(generator.random(n) < 0.5, generator.choice((math.nan, math.inf, -math.inf), n), at)
        elif kind == 2:
            at = at + generator.normal(0.0, 10.0 ** generator.uniform(-9.0, 0.0), n)
        elif kind == 3:
            velocity = generator.uniform(-4.0, 4.0, n)
        else:
            velocity = 0.98 * velocity + generator.normal(0.0, 0.05, n)
            at = at + PERIOD_S * velocity


@pytest.mark.parametrize("policy", ["limit", "reject"])
def test_no_adversary_gets_the_robot_out_of_limits_or_into_itself(tmp_path, policy):
    """The oracle knows the commands only; and what it samples, it brakes in full."""
    robot = folding(tmp_path)
    guard = guard_of(robot, policy=policy, limits=LIMITS)
    distances = LinkDistances(robot)
    pair = ("base", "lower")
    generator = np.random.default_rng(6)
    runs, commands, refused, lowest = [], [], 0, math.inf
    targets = adversary(generator, int(os.environ.get(FUZZ, 2500)), 2)
    target = next(targets)
    while True:
        decision = decide(guard, target)
        refused += decision.violation is not None
        if decision.command is not None:
            commands.append(decision.command)
            _check_place(distances, pair, decision.command)
            lowest = min(lowest, distances.distance(pair, 0.5))
        if decision.is_halted:
            if len(commands) > 1:
                runs.append(commands)
            commands = commands[-1:]
            guard.start()
        elif len(commands) % 100 == 0:
            for row in guard.stop_commands:
                _check_place(distances, pair, row)
        try:
            target = targets.send(commands[-1] if commands else (0.0, 0.0))
        except StopIteration:
            break
    runs.append(commands)
    assert refused > 50
    if policy == "limit":
        worst = worst_shares(runs[-1], LIMITS, PERIOD_S)
        assert max(worst.values()) <= 1.0 + ROUNDING, worst
        assert len(runs) == 1 and worst["velocity"] > 0.5 and lowest < 0.05, "the adversary was not near the limits"
    else:  # a run begins with a robot that stands, at most as far as a start may be from there
        worst = [worst_shares(run[1:], LIMITS, PERIOD_S) for run in runs if len(run) > 2]
        assert max(max(each.values()) for each in worst) <= 1.0 + ROUNDING


def _check_place(distances, pair, q):
    assert abs(q[0]) <= 2.0 and abs(q[1]) <= 3.0, q
    distances.place(np.array(q))
    assert distances.distance(pair, 0.0) > 0.0, q


class TestBadConfiguration:
    """What is wrong is named with file, key, what was expected and what came."""

    @pytest.mark.parametrize(
        "config, message",
        [
            ({"limits": {"lower": {"slide": 0.5}, "upper": {"slide": 0.2}}},
             "guard.yaml: limits.lower.slide: expected a lower limit below the upper one, got 0.5 and 0.2"),
            ({"limits": {"upper": {"slide": 1.5}}},
             r"guard.yaml: limits.upper.slide: expected a limit below that of .*slider.urdf, 1, got 1.5"),
            ({"limits": {"velocity": {"slide": 5.0}}},
             r"guard.yaml: limits.velocity.slide: expected at most that of .*slider.urdf, 2, got 5"),
            ({"limits": {"velocity": {"slid": 1.0}}},
             "guard.yaml: limits.velocity.slid: unknown joint; did you mean 'slide'?"),
            ({"checks": {"joint_velocty": {}}}, "guard.yaml: checks.joint_velocty: unknown check.*'joint_velocity'"),
            ({"policy": "stop"}, "guard.yaml: policy"),
        ],
    )  # fmt: skip
    def test_it_is_named(self, tmp_path, config, message):
        with pytest.raises(ConfigError, match=message):
            guard_of(slider(tmp_path), **config)
