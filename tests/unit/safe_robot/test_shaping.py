"""Targets that joints cannot follow are smoothed before they are judged."""

from __future__ import annotations

import numpy as np
import pytest
from guarded_arm import HOME, KUKA, LIMITS, PERIOD_S, decide, folding, guard_of, slider, worst_shares

from robot_model.model import RobotModel
from safe_robot.guard import Decision

QUICK_LIMITS = {"acceleration": 10.0, "jerk": 1000.0}
SMOOTHING = ({}, {"policy": "limit"}, {"shape": {}})
SWING = 0.3 * np.array((1.0, 0.5, 0.8, 0.6, 1.2, 0.9, 1.1))


def swung(times_s: np.ndarray) -> np.ndarray:
    """Returns targets of a motion of the arm that begins and ends at rest, well within its limits; k x n."""
    ramp = np.clip(times_s / 4.0, 0.0, 1.0)
    return np.array(HOME) + np.sin(2.0 * np.pi * ramp)[:, None] * np.sin(np.pi * ramp)[:, None] ** 2 * SWING


def trembling() -> np.ndarray:
    """Returns the same targets as they come from a source that looks at uneven times, and rests then."""
    times_s = np.arange(0.0, 5.0, PERIOD_S)
    return swung(times_s + np.random.default_rng(3).uniform(0.0, 2.0 * PERIOD_S, len(times_s)))


def test_targets_that_joints_can_follow_pass_to_the_last_bit():
    guard = guard_of(RobotModel(KUKA), shape={})
    for target in map(tuple, swung(np.arange(0.0, 4.0, PERIOD_S)).tolist()):
        assert decide(guard, target) == Decision(target)


def test_trembling_targets_are_followed_smoothly_and_without_a_stop():
    targets = list(map(tuple, trembling().tolist()))
    options = {"limits": QUICK_LIMITS, "checks": {"self_collision": {"active": False}}}
    guards = [guard_of(RobotModel(KUKA), **options, **each) for each in SMOOTHING]
    rough, limited, decisions = ([decide(guard, target) for target in targets] for guard in guards)
    assert any(decision.is_halted for decision in rough), "there was nothing to smooth"
    assert not any(decision.violation for decision in decisions)
    commands = np.array([decision.command for decision in decisions])
    shares = worst_shares(commands, {"velocity": 1.92, **QUICK_LIMITS}, PERIOD_S)
    assert max(shares.values()) <= 1.0 + 1e-6, shares
    followed = np.array([decision.command for decision in limited])
    assert np.diff(commands, 2, axis=0).std() < 0.5 * np.diff(followed, 2, axis=0).std(), "limits alone tremble on"
    assert np.abs(commands - targets).max() < 0.05
    assert decisions[-1] == Decision(targets[-1]), "at rest it is where it was to be, to the last bit"
    assert any(decision.is_shaped for decision in decisions)


@pytest.mark.parametrize("jerk", [LIMITS["jerk"], 1e6])
def test_a_joint_does_not_go_past_a_target_that_stops(tmp_path, jerk):
    limits = {**LIMITS, "jerk": jerk}
    guard = guard_of(slider(tmp_path), limits=limits, shape={"time_s": 0.01, "reach": 2.0})
    decide(guard, (0.0, 0.0))
    commands = [decide(guard, (0.5, -0.4)).command for _ in range(300)]
    assert commands[-1] == (0.5, -0.4)
    assert max(slide for slide, _ in commands) <= 0.5 + 1e-9 and min(turn for _, turn in commands) >= -0.4 - 1e-9
    shares = worst_shares([(0.0, 0.0), *commands], limits, PERIOD_S)
    assert max(shares.values()) <= 1.0 + 1e-6 and shares["velocity"] > 0.7, shares


@pytest.mark.parametrize(("measured", "begin"), [(0.01, 0.0), (0.2, 0.2)])
def test_motion_begins_at_last_command_or_at_the_measured_position(tmp_path, measured, begin):
    guard = guard_of(slider(tmp_path), shape={}, start_from="measured")
    assert decide(guard, (0.0, 0.0), measured={"slide": 0.0, "turn": 0.0}).command == (0.0, 0.0)
    guard.halt()
    guard.start()
    target, there = (measured + 0.02, 0.0), {"slide": measured, "turn": 0.0}
    commands = [(begin, 0.0), *(decide(guard, target, measured=there).command for _ in range(100))]
    assert commands[1] == (begin, 0.0), "controllers take the first command as rest"
    assert worst_shares(commands, LIMITS, PERIOD_S)["jerk"] <= 1.0 + 1e-6 and commands[-1] == target


@pytest.mark.parametrize(
    ("target", "check"),
    [((0.3, 1.9), "joint_velocity"), ((float("nan"), 1.9), "input"), ((0.0, 2.02), "joint_position")],
)
def test_jumps_and_invalid_targets_are_not_smoothed(tmp_path, target, check):
    guard = guard_of(slider(tmp_path), shape={}, limits={"velocity": 2.0})
    decide(guard, (0.0, 1.9))
    decision = decide(guard, target)
    assert decision.command is None and decision.is_halted and decision.violation.check == check


def test_joint_slightly_past_its_limit_is_kept_at_the_limit(tmp_path):
    guard = guard_of(slider(tmp_path), shape={})
    turns = 1.804 + 0.1 * (1.0 - np.cos(np.linspace(0.0, 2.0 * np.pi, 400)))
    decisions = [decide(guard, (0.0, turn)) for turn in (*turns.tolist(), *[turns[-1]] * 50)]
    assert not any(decision.violation for decision in decisions)
    commands = np.array([decision.command for decision in decisions])
    assert commands[:, 1].max() == 2.0 < turns.max()
    assert decisions[-1].command == (0.0, turns[-1])


def test_smoothed_targets_are_checked(tmp_path):
    """The elbow is led into the base, too fast at first."""
    guard = guard_of(folding(tmp_path), shape={}, checks={"self_collision": {"margin_m": 0.03}})
    decisions = [decide(guard, (1.2, min(0.008 * k, 2.8))) for k in range(400)]
    assert decisions[1].is_shaped and decisions[1].violation is None
    (refused,) = [decision for decision in decisions if decision.violation]
    assert refused.violation.check == "self_collision" and refused.command is None
    steps = np.diff([decision.command[1] for decision in decisions if decision.command])
    assert steps[-1] > 0.99 * steps[-20], "it halts at once, and does not brake before"


def test_too_fast_targets_are_followed_at_the_speed_limit(tmp_path):
    guard = guard_of(slider(tmp_path), shape={})
    decisions = [decide(guard, (1.2 * (k * PERIOD_S) ** 3, 0.0)) for k in range(60)]
    assert not any(decision.violation for decision in decisions)
    speed = np.diff([decision.command[0] for decision in decisions]) / PERIOD_S
    assert 0.9 < speed.max() <= 0.95
