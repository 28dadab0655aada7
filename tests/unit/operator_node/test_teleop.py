"""A frame that is moved by velocities: integration, box, time-outs, and no jump from anywhere."""

from __future__ import annotations

import math
import random

import pytest

from custom_ros_tools.errors import ConfigError
from operator_node.teleop import LATE_PERIODS, Teleop, TeleopConfig, TeleopPose

HZ = 100.0
ROUNDING = 1e-9


def made(timeout_s: float = 0.0, **options) -> Teleop:
    return Teleop(config(**options), timeout_s)


def config(**options) -> TeleopConfig:
    return TeleopConfig.parse({"target_frame_id": "target", "hz": HZ, **options}, "~config")


def run(teleop: Teleop, since_s: float, duration_s: float, hz: float = HZ) -> float:
    """Steps for some time, steadily; returns the time."""
    for number in range(1, round(duration_s * hz) + 1):
        teleop.step(since_s + number / hz)
    return since_s + duration_s


@pytest.mark.parametrize("hz", [60.0, 100.0, 170.0])
def test_displacement_is_velocity_times_true_time_at_any_rate(hz):
    """Defect 44: the release counts 1/hz for every step."""
    teleop = made()
    teleop.step(5.0)
    teleop.command((0.1, -0.2, 0.3, 0.4, 0.5, -0.6), 5.0)
    run(teleop, 5.0, 1.0, hz)
    assert teleop.pose.position == pytest.approx((0.1, -0.2, 0.3))
    assert teleop.pose.rpy == pytest.approx((0.4, 0.5, -0.6))


def test_three_numbers_are_a_velocity_without_rotation():
    """Defect 44: the release keeps the old rates."""
    teleop = made()
    teleop.command((0.0, 0.0, 0.0, 1.0, 0.0, 0.0), 0.0)
    now_s = run(teleop, 0.0, 0.5)
    turned = teleop.pose.rpy
    teleop.command((0.1, 0.0, 0.0), now_s)
    run(teleop, now_s, 0.5)
    assert teleop.pose.rpy == turned != (0.0, 0.0, 0.0)
    assert teleop.pose.position[0] > 0.04


def test_timer_that_is_late_makes_no_jump():
    teleop = made()
    teleop.step(0.0)
    teleop.command((1.0, 0.0, 0.0), 0.0)
    teleop.step(3.0)
    assert teleop.pose.position[0] == pytest.approx(LATE_PERIODS / HZ)
    teleop.step(2.0)
    assert teleop.pose.position[0] == pytest.approx(LATE_PERIODS / HZ), "a clock that goes back moves nothing"


def test_old_signal_ends_and_the_frame_stays_in_place():
    """Defect 44: the release goes on for ever."""
    teleop = made(timeout_s=0.2)
    teleop.step(0.0)
    teleop.command((0.5, 0.0, 0.0), 0.0)
    run(teleop, 0.0, 3.0)
    assert 0.5 * 0.2 - 0.01 <= teleop.pose.position[0] <= 0.5 * 0.2 + 0.01 and not teleop.moves
    without = made(timeout_s=0.0)
    without.step(0.0)
    without.command((0.5, 0.0, 0.0), 0.0)
    run(without, 0.0, 3.0)
    assert without.pose.position[0] == pytest.approx(1.5), "without a time-out it does go on"


def test_it_stays_within_its_box_axis_by_axis():
    teleop = made(xlim=[-0.1, 0.2], ylim=[-0.3, 0.0], zlim=[-math.inf, 0.4])
    for velocity, corner in (((1.0, 1.0, 1.0), (0.2, 0.0, 0.4)), ((-1.0, -1.0, -1.0), (-0.1, -0.3, -1.6))):
        teleop.command(velocity, 0.0)
        run(teleop, 0.0, 2.0)
        assert teleop.pose.position == pytest.approx(corner, abs=0.02)


def test_reset_sets_the_pose_and_is_refused_outside_the_box():
    teleop = made(ylim=[-1.0, 1.0])
    teleop.command((0.3, 0.0, 0.0), 0.0)
    for pose, told in (
        (TeleopPose((0.0, 1.5, 0.0)), "y must be within -1 and 1 m, got 1.5"),
        (TeleopPose((math.nan, 0.0, 0.0)), "must be finite"),
        (TeleopPose((0.0, 0.0, 0.0), (math.inf, 0.0, 0.0)), "must be finite"),
    ):
        with pytest.raises(ValueError, match=told):
            teleop.reset(pose)
        assert teleop.pose == TeleopPose() and teleop.moves
    there = TeleopPose((9.0, 0.5, -9.0), (0.1, 0.2, 0.3))
    teleop.reset(there)
    run(teleop, 0.0, 1.0)
    assert teleop.pose == there, "it stands still until the next signal"


@pytest.mark.parametrize(
    "signal", [(), (0.1,), (0.1,) * 4, (0.1,) * 7, (math.nan, 0, 0), (0, 0, 0, 0, 0, math.inf), (1.7e308,) * 3]
)
def test_invalid_signal_is_refused_and_stops_the_frame(signal):
    teleop = made()
    teleop.command((0.5, 0.0, 0.0), 0.0)
    with pytest.raises(ValueError, match=r"expected 3 numbers|must be finite|expected a velocity"):
        teleop.command(signal, 0.0)
    run(teleop, 0.0, 1.0)
    assert teleop.pose == TeleopPose()


def test_too_fast_signal_is_scaled_down_and_reported():
    teleop = made(max_speed=0.5, max_turn_rate=1.0)
    teleop.step(0.0)
    assert not teleop.command((0.3, 0.4, 0.0, 1.0, 0.0, 0.0), 0.0)
    assert teleop.command((3.0, 4.0, 0.0, 0.5, -9.0, 0.0), 0.0)
    run(teleop, 0.0, 1.0)
    assert teleop.pose.position == pytest.approx((0.3, 0.4, 0.0))
    assert teleop.pose.rpy == pytest.approx((0.5, -1.0, 0.0))


def test_angles_stay_within_a_turn():
    teleop = made()
    teleop.command((0.0, 0.0, 0.0, 0.0, 0.0, 3.0), 0.0)
    for _ in range(10):
        run(teleop, 0.0, 1.0)
        assert abs(teleop.pose.rpy[2]) <= math.pi


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"xlim": [0.1, 0.5]}, "xlim: expected the least and the largest value, with 0 between them, got [0.1, 0.5]"),
        ({"ylim": [0.5, -0.5]}, "ylim: expected the least"),
        ({"zlim": [math.nan, 0.5]}, "zlim: expected the least"),
        ({"zlim": [0.5]}, "zlim: expected a list of 2 numbers [m], got 1"),
        ({"hz": 0}, "hz: must be > 0 [Hz], got 0"),
        ({"parent_frame_id": "target"}, "target_frame_id: must differ from parent_frame_id, 'target'"),
        ({"max_speed": math.inf}, "max_speed: must be a finite number"),
        ({"target_frame": "target"}, "unknown key 'target_frame'; did you mean 'target_frame_id'?"),
    ],
)
def test_bad_configuration_is_reported_with_key_and_values(options, told):
    with pytest.raises(ConfigError) as error:
        config(**options)
    assert told in str(error.value)


def test_nothing_is_limited_unless_it_is_said():
    assert config().box == ((-math.inf, math.inf),) * 3
    assert config(zlim=[0, 0]).zlim == (0.0, 0.0), "an axis may be held"


def test_no_jump_from_random_offsets_at_start_reset_and_reconnect():
    """Wherever the frame is when a signal begins, and whatever the signal, no step is longer than v_max dt."""
    generator = random.Random(13)
    longest = 0.0
    for _ in range(1000):
        v_max = generator.uniform(0.05, 2.0)
        teleop = made(timeout_s=0.1, max_speed=v_max, xlim=[-5.0, 5.0], ylim=[-5.0, 5.0], zlim=[-5.0, 5.0])
        now_s = generator.uniform(0.0, 1e5)
        offset = TeleopPose(tuple(generator.uniform(-5.0, 5.0) for _ in range(3)), (0.0, 0.0, 3.0))
        for event in ("start", "reset", "reconnect"):
            if event == "reset":
                teleop.reset(offset)
            now_s += generator.uniform(0.2, 100.0) if event == "reconnect" else 1.0 / HZ
            before = teleop.pose
            assert teleop.step(now_s) == before, "it waits for a signal"
            for _ in range(5):
                signal = [generator.choice((-1.0, 1.0)) * 10.0 ** generator.uniform(-3, 3) for _ in range(3)]
                teleop.command(signal, now_s)
                dt_s = generator.choice((1.0 / HZ, generator.uniform(0.0, 3.0 / HZ), generator.uniform(0.0, 50.0)))
                now_s += dt_s
                before, after = teleop.pose, teleop.step(now_s)
                step_m = math.dist(before.position, after.position)
                assert step_m <= v_max * min(dt_s, LATE_PERIODS / HZ) + ROUNDING
                longest = max(longest, step_m)
    assert longest > 0.03, "they are not all small because nothing moves"
