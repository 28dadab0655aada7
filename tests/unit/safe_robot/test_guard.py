"""What the guard lets pass, and what it does instead."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from guarded_arm import HOME, KUKA, LIMITS, PERIOD_S, BrokenCheck, decide, folding, guard_of, slider, worst_shares

from custom_ros_tools.errors import ConfigError
from robot_model.model import RobotModel
from safe_robot.check import CheckContext, Violation
from safe_robot.guard import Decision

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
    robot = RobotModel(KUKA)
    guard = guard_of(robot, policy=policy)
    for target in smooth(robot, 3.0, at=HOME):
        decision = decide(guard, target)
        assert decision == Decision(target)


def test_reject_sends_nothing_after_an_unsafe_target_until_restarted(tmp_path):
    guard = guard_of(slider(tmp_path))
    assert decide(guard, (0.0, 0.0)).command == (0.0, 0.0)
    decision = decide(guard, (0.1, 0.0))
    assert decision.command is None and decision.is_halted
    assert decision.violation == Violation(
        "joint_velocity", "joint 'slide'", pytest.approx(10.0), 0.95, "m/s", quantity="velocity"
    )
    assert str(decision.violation) == "joint_velocity: joint 'slide': velocity is 10 m/s, limit 0.95 m/s"
    assert decide(guard, (0.0, 0.0)) == Decision(None, is_halted=True)
    guard.start()
    assert decide(guard, (0.0, 0.0)).command == (0.0, 0.0)


def test_only_speeds_that_can_be_braked_pass_before_position_limits(tmp_path):
    """The same speed is safe in the middle and not near the limit, though the target is within all limits."""
    robot = slider(tmp_path)
    guard = guard_of(robot)
    targets = [(0.62 + x, 0.0) for x, _ in smooth(robot, 3.0, 0.45)]
    decisions = [decide(guard, target) for target in targets]
    first = next(i for i, decision in enumerate(decisions) if decision.command is None)
    violation = decisions[first].violation
    assert violation.check == "joint_position" and violation.is_while_braking and violation.limit == 1.0
    assert 0.9 < targets[first][0] < 1.0


def test_motion_that_cannot_be_braked_is_unsafe_without_any_check(tmp_path):
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
    guard = guard_of(slider(tmp_path))
    guard.checks = [BrokenCheck(None, None, None, ""), *guard.checks]
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

    def test_guard_waits_until_obstacles_are_known(self, tmp_path):
        guard = guard_of(slider(tmp_path), checks={"environment": {}})
        decision = decide(guard, (0.0, 0.0))
        assert decision.command is None and not decision.is_halted and decision.violation.check == "environment"
        assert decide(guard, (0.0, 0.0), obstacles=()).command == (0.0, 0.0)
        assert decide(guard, (0.0, 0.0)).is_halted

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


def test_watchdog_reports_missing_targets_only_while_the_robot_moves(tmp_path):
    robot = slider(tmp_path)
    guard = guard_of(robot)
    targets = list(smooth(robot, 1.0))
    decide(guard, targets[0])
    assert guard.check_watchdogs(CheckContext(since_command_s=10.0)) is None
    for target in targets[1:50]:
        assert decide(guard, target).violation is None
    assert guard.check_watchdogs(CheckContext(since_command_s=0.09)) is None
    assert guard.check_watchdogs(CheckContext(since_command_s=0.11)).check == "staleness"
    assert guard.is_halted


@pytest.mark.parametrize("policy", ["reject", "limit"])
def test_targets_of_one_stamp_are_one_target(tmp_path, policy):
    """A busy machine repeats stamps, since simulated time stands still between two messages of /clock."""
    robot = slider(tmp_path)
    once, repeated = guard_of(robot, policy=policy), guard_of(robot, policy=policy)
    for target in smooth(robot, 1.0):
        assert decide(repeated, target, stamp_step_s=PERIOD_S) == decide(once, target)
        for _ in range(3):
            assert decide(repeated, (0.9, 0.9), stamp_step_s=0.0, since_command_s=0.05) == Decision(None)
    assert np.array_equal(repeated.stop_commands, once.stop_commands)


@pytest.mark.parametrize("policy", ["reject", "limit"])
def test_unchanged_stamp_stops_a_moving_robot(tmp_path, policy):
    guard = guard_of(slider(tmp_path), policy=policy)
    for target in list(smooth(guard.robot, 1.0))[:50]:
        decide(guard, target)
    known, repeated = guard.stop_commands, {"stamp_step_s": 0.0, "since_command_s": 0.11}
    first = decide(guard, target, **repeated)
    assert first.violation.check == "staleness" and first.is_halted == (policy == "reject")
    commands = [first.command, *(decide(guard, target, **repeated).command for _ in known)]
    braking = [*map(tuple, known), None] if policy == "limit" else [None] * (len(known) + 1)
    assert commands == braking, "once the robot rests, nothing more is commanded"


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

    def test_invalid_target_brakes_the_robot(self, tmp_path):
        robot = slider(tmp_path)
        guard = guard_of(robot, policy="limit")
        commands = [decide(guard, target).command for target in list(smooth(robot, 1.0))[:60]]
        commands += [decide(guard, (math.nan, 0.0)).command for _ in range(100)]
        assert max(worst_shares(commands, LIMITS, PERIOD_S).values()) <= 1.0 + ROUNDING
        assert commands[-1] == commands[-2] and not guard.is_moving

    def test_late_targets_brake_it_until_the_next(self, tmp_path):
        """A busy computer delays targets: the robot rests meanwhile, and follows the next one without a call."""
        robot = slider(tmp_path)
        guard = guard_of(robot, policy="limit", on_halt="brake")
        commands = [decide(guard, target).command for target in list(smooth(robot, 1.0))[:50]]
        known, late = guard.stop_commands, CheckContext(since_command_s=0.11)
        assert guard.check_watchdogs(late).check == "staleness" and guard.is_braking and not guard.is_halted
        assert guard.check_watchdogs(late) is None, "it is reported once"
        braking = list(iter(guard.next_braking, None))
        assert np.array_equal(braking, known) and not guard.is_braking
        commands += [*braking, *(decide(guard, (0.5, 0.5)).command for _ in range(300))]
        assert max(worst_shares(commands, LIMITS, PERIOD_S).values()) <= 1.0 + ROUNDING
        assert commands[-1] == pytest.approx((0.5, 0.5), abs=1e-3)

    def test_a_target_during_the_braking_for_late_ones_ends_it(self, tmp_path):
        robot = slider(tmp_path)
        guard = guard_of(robot, policy="limit", on_halt="brake")
        commands = [decide(guard, target).command for target in list(smooth(robot, 1.0))[:50]]
        guard.wait_for_target()
        commands += [guard.next_braking(), guard.next_braking(), decide(guard, (0.5, 0.5)).command]
        assert guard.is_moving and not guard.is_braking and guard.next_braking() is None
        commands += [decide(guard, (0.5, 0.5)).command for _ in range(300)]
        assert max(worst_shares(commands, LIMITS, PERIOD_S).values()) <= 1.0 + ROUNDING

    def test_a_broken_check_halts_it_while_targets_are_late(self, tmp_path):
        robot = slider(tmp_path)
        guard = guard_of(robot, policy="limit", on_halt="brake")
        for target in list(smooth(robot, 1.0))[:50]:
            decide(guard, target)
        guard.wait_for_target()
        guard.checks = [BrokenCheck(None, None, None, ""), *guard.checks]
        with pytest.raises(ZeroDivisionError):
            guard.check_watchdogs(CheckContext())
        assert guard.is_halted

    def test_after_late_targets_without_braking_it_begins_at_rest(self, tmp_path):
        robot = slider(tmp_path)
        guard = guard_of(robot, policy="limit")
        commands = [decide(guard, target).command for target in list(smooth(robot, 1.0))[:50]]
        assert guard.check_watchdogs(CheckContext(since_command_s=0.11)).check == "staleness"
        assert not guard.is_halted and not guard.is_moving and guard.next_braking() is None
        stands = [commands[-1]] * 3
        commands = [decide(guard, (0.5, 0.5)).command for _ in range(300)]
        assert max(worst_shares([*stands, *commands], LIMITS, PERIOD_S).values()) <= 1.0 + ROUNDING
        assert commands[-1] == pytest.approx((0.5, 0.5), abs=1e-3)

    def test_motion_away_from_a_near_body_may_be_fast(self, tmp_path):
        """Out of the margin of a self-collision, the speed is that of anywhere."""
        robot = folding(tmp_path)
        limits = {**LIMITS, "velocity_factor": 1.0}
        start = (0.0, 2.60)
        guard = guard_of(robot, policy="limit", limits=limits, checks={"self_collision": {"margin_m": 0.1}})
        assert decide(guard, start).command == start
        commands = [start, *(decide(guard, (0.0, 0.0)).command for _ in range(150))]
        speed = np.abs(np.diff(np.array(commands)[:, 1])) / PERIOD_S
        assert speed.max() >= 0.95 * LIMITS["velocity"]


def test_without_a_solver_it_scales_back(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr("safe_robot.guard.can_keep_bounds", lambda: False)
    robot = folding(tmp_path)
    guard = guard_of(robot, policy="limit", limits=LIMITS)
    assert "run `./rpbi setup ik`" in caplog.text
    commands = [decide(guard, (0.0, target)).command for target in [0.0, *[2.9] * 400]]
    assert max(worst_shares(commands, LIMITS, PERIOD_S).values()) <= 1.0 + ROUNDING
    assert 2.0 < commands[-1][1] < 2.9


def test_limit_policy_slides_along_an_obstacle(tmp_path):
    """One joint is held back by the base; the other one goes to its target as fast as ever."""
    pytest.importorskip("daqp")
    guard = guard_of(folding(tmp_path), policy="limit", limits=LIMITS, checks={"self_collision": {"margin_m": 0.05}})
    commands = [decide(guard, target).command for target in [(0.0, 2.0), *[(1.0, 2.9)] * 300]]
    assert commands[-1][0] == pytest.approx(1.0, abs=1e-2) and commands[-1][1] > 2.3


class TestInsideTheMargin:
    """A robot that starts too near to something."""

    START = (0.0, 2.60)
    CHECKS = {"self_collision": {"margin_m": 0.1}}

    def test_way_out_names_the_direction_that_leads_away(self, tmp_path):
        guard = guard_of(folding(tmp_path), policy="limit", limits=LIMITS, checks=self.CHECKS)
        assert guard.way_out() is None, "nobody knows where it is"
        decide(guard, self.START)
        out = guard.way_out()
        assert out.direction[1] == pytest.approx(-1.0) and not out.is_locked
        assert re.fullmatch(
            r"inside the margin of self_collision \(links 'base' and 'lower': [\d.]+ of 100.0 mm\): "
            r".*elbow -1.00 leads away",
            out.words(guard.joint_names),
        )
        for _ in range(100):
            decide(guard, (0.0, 1.5))
        assert guard.way_out() is None

    def test_a_joint_at_its_limit_leads_no_further(self, tmp_path):
        """The elbow is at its limit and the shoulder alone hardly moves what is near."""
        limits = {**LIMITS, "lower": {"elbow": 2.6}}
        guard = guard_of(folding(tmp_path), policy="limit", limits=limits, checks=self.CHECKS)
        decide(guard, self.START)
        out = guard.way_out()
        assert out.is_locked or out.direction[1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("jerk", [200.0, *(pytest.param(jerk, marks=pytest.mark.thorough) for jerk in (300.0, 1000.0))])
def test_joint_does_not_overshoot_a_constant_target(tmp_path, jerk):
    """Neither by going on after a target that it reaches too fast, nor by another braking than the one before."""
    robot, generator = slider(tmp_path), np.random.default_rng(0)
    for target in generator.uniform(-0.9, 0.9, (12, 2)):
        guard = guard_of(robot, policy="limit", limits={**LIMITS, "jerk": jerk})
        decide(guard, (0.0, 0.0))
        commands = [decide(guard, target).command for _ in range(250)]
        assert commands[-1] == tuple(target)
        assert (np.sign(target) * (np.array(commands) - target)).max() <= 1e-9
        shares = worst_shares([(0.0, 0.0), *commands], {**LIMITS, "jerk": jerk}, PERIOD_S)
        assert max(shares.values()) <= 1.0 + 1e-6, shares


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
            ({"period_s": 1e-300}, "guard.yaml: period_s: must be >= 1e-05"),
            ({"limits": {"acceleration": 1e-6}}, "guard.yaml: limits: expected limits such that braking takes"),
            ({"joint_names": []}, r"guard.yaml: joint_names: expected a joint, got \[\]"),
            ({"joint_names": ["turn"] * 2}, "guard.yaml: joint_names: expected each joint once, got text 'turn' twice"),
        ],
    )  # fmt: skip
    def test_it_is_named(self, tmp_path, config, message):
        with pytest.raises(ConfigError, match=message):
            guard_of(slider(tmp_path), **config)
