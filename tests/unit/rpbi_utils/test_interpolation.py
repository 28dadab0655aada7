"""Motions through waypoints: exact at waypoints, smooth where they are replanned, and strict about their input."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from custom_ros_tools.errors import ConfigError
from robot_model.geometry import (
    Quaternion,
    minus,
    normalized,
    quaternion_of,
    quaternion_product,
    rotation_between,
    scaled,
)
from rpbi_utils.interpolation.config import WaypointError, WaypointMotionConfig
from rpbi_utils.interpolation.interpolator import Interpolator, TargetSample
from rpbi_utils.interpolation.rotation import RotationKnot, RotationPath
from rpbi_utils.interpolation.waypoints import read_waypoints, waypoint_matrix

FRAMES = {"publisher": {"header_frame_id": "world", "msg_child_frame_id": "target"}}
TRANS = {f"translation_{axis}_index": i for i, axis in enumerate("xyz")}
QUAT = {"rotation_repr": "quat", "rotation_vec_index": [3, 7]}
SEEDS = range(20)


def motion(
    number: int, rotation: dict[str, Any] | None = None, trans: Any = TRANS, **more: Any
) -> WaypointMotionConfig:
    """Returns the configuration of a frame's motion; `more` is the part `interpolation`."""
    dimensions = {"number": number, "trans": trans, "rotation": rotation or {"rotation_repr": "none"}}
    data = {"motion_dimensions": dimensions, "interpolation": more, "communication": FRAMES}
    return WaypointMotionConfig.parse(data, "traj.yaml")


def joints(*names: str, **more: Any) -> WaypointMotionConfig:
    data = {"motion_dimensions": {"number": len(names), "joint_names": list(names)}, "interpolation": more}
    return WaypointMotionConfig.parse(data, "traj.yaml")


def add(plan: Interpolator, config: WaypointMotionConfig, rows: Any, now_s: float) -> None:
    """Adds waypoints whose times begin now."""
    waypoints = read_waypoints(np.array(rows, dtype=float), config.motion_dimensions)
    plan.add(waypoints._replace(times_s=tuple(now_s + t for t in waypoints.times_s)), now_s)


def samples(plan: Interpolator, start_s: float, end_s: float, tick_s: float = 0.01) -> list[TargetSample]:
    """Returns what is published by ticks at a rate."""
    ticks = start_s + tick_s * np.arange(math.floor((end_s - start_s) / tick_s + 1e-6) + 1)
    return [sample for tick in ticks for sample in [plan.newest(float(tick))] if sample is not None]


def angle(a: Quaternion, b: Quaternion) -> float:
    return math.hypot(*rotation_between(a, b))


def random_quat(rng: np.random.Generator) -> Quaternion:
    return normalized(rng.normal(size=4).tolist())


def test_samples_have_true_times_independent_of_the_tick_rate():
    """The release stretched n samples over the whole time, and played one at each tick."""
    config = joints("a", inter_dt=0.03)
    of_rates = []
    for tick_s in (0.03, 0.005, 0.001):
        plan = Interpolator(config)
        add(plan, config, [[0.0, 1.0], [0.0, 1.0], [1.0, 1.0]], 5.0)  # a line: the value is the time
        got = samples(plan, 5.0, 6.5, tick_s)
        assert [each.state.position[0] for each in got] == pytest.approx([each.time_s - 5.0 for each in got], abs=1e-9)
        of_rates.append([each.time_s for each in got])
    assert of_rates[0][:-1] == pytest.approx([5.0 + 0.03 * k for k in range(34)])
    assert of_rates[0][-1] == 6.0, "the end is a sample, though it is not on the grid"
    assert of_rates[0] == pytest.approx(of_rates[1]) and of_rates[1] == pytest.approx(of_rates[2])


def test_a_slow_rate_leaves_samples_out_and_is_as_fast():
    config = joints("a")
    plan = Interpolator(config)
    add(plan, config, [[0.0, 2.0], [0.0, 2.0], [1.0, 1.0]], 0.0)
    got = samples(plan, 0.0, 3.0, 0.25)
    assert [each.time_s for each in got] == pytest.approx([0.25 * k for k in range(9)])
    assert [each.state.position[0] for each in got] == pytest.approx([0.25 * k for k in range(9)])


@pytest.mark.parametrize("method", ["linear", "cubic", "quintic"])
def test_waypoints_are_met_at_their_times(method):
    config = motion(7, QUAT, method=method, inter_dt=0.5)
    rng = np.random.default_rng(3)
    times = [0.0, 1.0, 2.5, 4.0]
    quats = [random_quat(rng) for _ in times]
    xyz = rng.normal(size=(3, 4))
    plan = Interpolator(config)
    add(plan, config, [times, *xyz, *np.transpose(quats), *np.zeros((7, 4))], 2.0)
    got = {each.time_s - 2.0: each.pose for each in samples(plan, 2.0, 7.0, 0.5)}
    for k, time_s in enumerate(times):
        assert got[time_s].position == pytest.approx(xyz[:, k])
        assert angle(got[time_s].quat_xyzw, quats[k]) < 1e-6


def test_derivatives_are_met_and_estimated_where_there_are_none():
    config = joints("a")
    for rows, expected in (
        ([[0, 1, 2], [0, 1, 0], [0.5, -2.0, 0.25]], (0.5, -2.0)),
        ([[0, 1, 3], [0, 1, 2]], (0.0, (2 * 1 + 1 * 0.5) / 3)),
    ):
        plan = Interpolator(config)
        add(plan, config, rows, 0.0)
        at = {round(each.time_s, 6): each.state.velocity[0] for each in samples(plan, 0.0, 2.9)}
        assert (at[0.0], at[1.0]) == pytest.approx(expected)


def speed_jump(times: Any, values: Any) -> tuple[float, float]:
    """Returns the largest differences of neighbouring values and of their slopes."""
    steps = np.diff(values, axis=0)
    slopes = steps / np.diff(times)[:, np.newaxis]
    return float(np.abs(steps).max()), float(np.abs(np.diff(slopes, axis=0)).max())


@pytest.mark.parametrize("method", ["linear", "cubic", "quintic"])
@pytest.mark.parametrize("seed", SEEDS)
def test_replanning_keeps_position_and_velocity(method, seed):
    """At each of three takeovers; with another seed, waypoints come at other moments and go elsewhere."""
    config = motion(7, QUAT, method=method, inter_dt=0.002, nochange_window_length=5)
    rng, plan, got = np.random.default_rng(seed), Interpolator(config), []
    takeovers, now_s = [], 0.0
    for _ in range(4):
        quats = np.transpose([random_quat(rng) for _ in range(4)])
        add(plan, config, [[0, 1, 2, 3], *rng.normal(size=(3, 4)), *quats], now_s)
        takeovers.append(now_s + 5 * 0.002)
        until_s = now_s + rng.uniform(0.2, 2.8)
        got += samples(plan, now_s, until_s, 0.002)
        now_s = got[-1].time_s
    times = np.array([each.time_s for each in got])
    assert np.diff(times) == pytest.approx(0.002)
    assert got[0].pose is not None
    turns = [rotation_between(a.pose.quat_xyzw, b.pose.quat_xyzw) for a, b in zip(got, got[1:])]
    spins = np.array([scaled(1 / 0.002, turn) for turn in turns])
    places = np.array([each.pose.position for each in got])
    speeds = np.diff(places, axis=0) / 0.002
    for takeover in takeovers[1:]:
        at = int(np.searchsorted(times, takeover - 1e-6))
        assert np.abs(speeds[at] - speeds[at - 1]).max() < 0.15, "within what the curves bend in a step"
        assert np.abs(spins[at] - spins[at - 1]).max() < 0.3
    assert np.abs(np.diff(places, axis=0)).max() < 0.05
    assert max(math.hypot(*turn) for turn in turns) < 0.05, "no rotation jumps"
    signs = [np.dot(a.pose.quat_xyzw, b.pose.quat_xyzw) for a, b in zip(got, got[1:])]
    assert min(signs) > 0.99, "nor do the four numbers"


@pytest.mark.parametrize("seed", SEEDS)
def test_protected_samples_are_those_of_the_plan_before(seed):
    rng = np.random.default_rng(seed)
    window = int(rng.integers(0, 40))
    config = joints("a", "b", nochange_window_length=window)
    first = [[0, 1, 2], *rng.normal(size=(4, 3))]
    undisturbed, plan = Interpolator(config), Interpolator(config)
    for each in (undisturbed, plan):
        add(each, config, first, 0.0)
    at_s = float(rng.uniform(0.1, 1.0))
    expected = samples(undisturbed, 0.0, 2.0)
    got = samples(plan, 0.0, at_s)
    add(plan, config, [[0, 1, 2], *rng.normal(size=(4, 3))], at_s)
    got += samples(plan, got[-1].time_s + 0.01, 3.5)
    count = math.floor(at_s / 0.01 + 1e-9) + 1 + window
    for kept, before in zip(got[:count], expected[:count]):
        assert kept.state.position == pytest.approx(before.state.position, abs=1e-12)
    assert got[count + 3].state.position != pytest.approx(expected[count + 3].state.position, abs=1e-9)


def test_interpolator_plays_many_motions_and_restarts_after_forget():
    config = joints("a")
    plan = Interpolator(config)
    add(plan, config, [[0, 1], [0, 1]], 0.0)
    assert samples(plan, 0.0, 5.0)[-1].state.position == (1.0,)
    assert plan.newest(6.0) is None, "it stops when the waypoints end"
    add(plan, config, [[0, 1], [7, 2]], 6.0)
    got = samples(plan, 6.0, 8.0)
    assert got[0].state.position[0] == pytest.approx(1.0, abs=1e-3), "from where it is, not from the first waypoint"
    assert got[-1].state.position == (2.0,) and got[-1].time_s == pytest.approx(7.0)
    plan.forget()
    add(plan, config, [[0, 1], [7, 2]], 9.0)
    assert samples(plan, 9.0, 9.0)[0].state.position == (7.0,)


def test_the_last_target_is_repeated_on_request():
    config = joints("a", hold=True, inter_dt=0.03)
    plan = Interpolator(config)
    add(plan, config, [[0, 1], [0, 2], [0, 0]], 0.0)
    got = samples(plan, 0.0, 2.0)
    at_rest = [each for each in got if each.time_s >= 1.0]
    assert len(at_rest) == 34 and {each.state for each in at_rest} == {((2.0,), (0.0,), (0.0,))}
    add(plan, config, [[0, 1], [9, 3]], 2.0)
    again = samples(plan, 2.01, 3.5)
    assert max(abs(b.state.position[0] - a.state.position[0]) for a, b in zip(again, again[1:])) < 0.05
    assert again[-1].state.position == (3.0,)


def test_times_need_not_start_at_0():
    """The release extrapolated: a value of 6 instead of 1."""
    config = joints("a")
    plan = Interpolator(config)
    add(plan, config, [[2, 3], [1, 2]], 0.0)
    got = samples(plan, 0.0, 4.0)
    assert (got[0].time_s, got[0].state.position) == (pytest.approx(2.0), (1.0,))
    assert (got[-1].time_s, got[-1].state.position) == (pytest.approx(3.0), (2.0,))


def peaks_of(got: list[TargetSample]) -> tuple[float, float]:
    """Returns the largest speed and acceleration of the first row, by differences of the positions."""
    steps = np.diff([each.time_s for each in got])
    speeds = np.diff([each.state.position[0] for each in got]) / steps
    return float(np.abs(speeds).max()), float(np.abs(2.0 * np.diff(speeds) / (steps[1:] + steps[:-1])).max())


QUICK = [[0.0, 0.1, 0.2, 0.3], [0.0, 0.5, 0.45, 1.0]]
"""A motion of 1 m in 0.3 s, with up to 200 m/s^2."""


@pytest.mark.parametrize("method", ["cubic", "quintic"])
def test_a_motion_is_slowed_down_to_its_limits(method):
    free = Interpolator(joints("a", inter_dt=0.001, method=method))
    add(free, joints("a"), QUICK, 0.0)
    assert peaks_of(samples(free, 0.0, 0.4, 0.001))[1] > 150.0
    config = joints("a", inter_dt=0.001, method=method, limits={"velocity": 1.5, "acceleration": 4.0})
    plan = Interpolator(config)
    added = plan.add(read_waypoints(np.array(QUICK), config.motion_dimensions), 0.0)
    got = samples(plan, 0.0, 5.0, 0.001)
    speed, acceleration = peaks_of(got)
    assert speed <= 1.5 and 3.8 < acceleration <= 4.0
    assert got[-1].state.position[0] == 1.0 and got[-1].time_s == pytest.approx(0.3 * added.stretch)
    assert added.excess.text.startswith("acceleration 2") and added.excess.text.endswith("rad/s^2, limit 4")


@pytest.mark.parametrize("seed", range(5))
def test_limits_hold_while_the_motion_is_replanned(seed):
    rng = np.random.default_rng(seed)
    config = joints("a", inter_dt=0.001, limits={"velocity": 1.0, "acceleration": 6.0})
    plan, got = Interpolator(config), []
    for start_s in (0.0, 0.4, 0.8):
        add(plan, config, [[0.1, 0.3, 0.6], rng.uniform(-0.5, 0.5, 3)], start_s)
        got += samples(plan, start_s, start_s + (0.4 if start_s < 0.8 else 8.0), 0.001)
    speed, acceleration = peaks_of(got)
    assert speed <= 1.001 and acceleration <= 6.05, "but for differences at knots"
    assert plan.plan.scalars.end_s < 8.0


def test_orientations_keep_their_limits():
    config = motion(7, QUAT, limits={"angular_velocity": 0.5, "angular_acceleration": 2.0})
    plan = Interpolator(config)
    turned = quaternion_of((0.0, 0.0, 1.5))
    rows = [[0.0, 0.1], *[[0.0, 0.1]] * 3, *zip((0.0, 0.0, 0.0, 1.0), turned)]
    added = plan.add(read_waypoints(np.array(rows), config.motion_dimensions), 0.0)
    assert added.peaks.angular_velocity == pytest.approx(0.5, rel=0.01) and added.stretch > 40.0
    quats = [each.pose.quat_xyzw for each in samples(plan, 0.0, 10.0)]
    assert max(angle(*pair) for pair in zip(quats, quats[1:])) / 0.01 <= 0.5


def test_a_motion_beyond_its_limits_is_refused_on_request():
    config = joints("a", "b", limits={"velocity": [9.0, 0.5], "exceeded": "refuse"})
    plan = Interpolator(config)
    with pytest.raises(
        WaypointError, match="expected a motion within the limits, got velocity of row 1 1.5 .*limit 0.5"
    ):
        add(plan, config, [[0.0, 1.0], [0.0, 1.0], [0.0, 1.0]], 0.0)
    assert plan.plan is None
    add(plan, config, [[0.0, 4.0], [0.0, 1.0], [0.0, 1.0]], 0.0)


def test_a_motion_that_has_not_begun_is_replaced():
    config = joints("a")
    plan = Interpolator(config)
    add(plan, config, [[5, 6], [1, 2]], 0.0)
    add(plan, config, [[0, 1], [3, 4]], 0.5)
    assert samples(plan, 0.5, 0.5)[0].state.position == (3.0,)


def test_a_pause_takes_time_and_nothing_else():
    config = joints("a")
    plan = Interpolator(config)
    add(plan, config, [[0, 1], [0, 1], [1, 1]], 0.0)
    samples(plan, 0.0, 0.5)
    plan.pause(0.5)
    assert plan.newest(0.7) is None
    plan.resume(2.5)
    got = samples(plan, 2.5, 4.0)
    assert got[0].state.position[0] == pytest.approx(0.51, abs=0.011)
    assert (got[-1].time_s, got[-1].state.position) == (pytest.approx(3.0), (1.0,))


def test_without_interpolation_waypoints_come_as_they_are():
    config = motion(7, QUAT, use_interpolation=False)
    rng, plan = np.random.default_rng(1), Interpolator(config)
    quats = [random_quat(rng) for _ in range(3)]
    rows = [[0.0, 0.5, 0.73], *rng.normal(size=(3, 3)), *np.transpose(quats)]
    add(plan, config, rows, 1.0)
    got = samples(plan, 1.0, 3.0)
    assert [each.time_s for each in got] == pytest.approx([1.0, 1.5, 1.73])
    assert [each.pose.position for each in got] == [pytest.approx(column) for column in np.transpose(rows[1:4])]
    assert all(angle(each.pose.quat_xyzw, quat) < 1e-9 for each, quat in zip(got, quats))


def test_constant_and_planned_dimensions():
    trans = {"translation_x": 0.25, "translation_y_index": 1, "translation_z": -1.0, "translation_z_index": 0}
    turn = {"rotation_repr": "theta", "rotation_vec": [0, 0, 2], "rotation_vec_index": [0]}
    config = motion(2, turn, trans)
    plan = Interpolator(config)
    add(plan, config, [[0, 1], [0.0, 4 * math.pi], [3, 5], [4 * math.pi, 4 * math.pi], [2, 2]], 0.0)
    got = {round(each.time_s, 6): each.pose for each in samples(plan, 0.0, 1.0)}
    assert got[0.5].position == pytest.approx((0.25, 4.0, -1.0))
    assert got[0.5].quat_xyzw == pytest.approx((0, 0, 0, -1), abs=1e-9), "two turns, as the numbers say"
    assert angle(got[0.25].quat_xyzw, (0, 0, 1, 0)) < 1e-6
    tilted = motion(3, {"rotation_repr": "None", "rotation_vec": [1, 0, 0], "rotation_angle": 90.0})
    plan = Interpolator(tilted)
    add(plan, tilted, [[0, 1], *np.ones((6, 2))], 0.0)
    assert plan.newest(0.0).pose.quat_xyzw == pytest.approx((math.sqrt(0.5), 0, 0, math.sqrt(0.5)))


def test_each_representation_has_its_rotation_and_the_shortest_path_wraps():
    yaw_pitch_roll = (0.7, -0.4, 1.9)
    halves = [(0.5 * yaw_pitch_roll[0], 2), (0.5 * yaw_pitch_roll[1], 1), (0.5 * yaw_pitch_roll[2], 0)]
    expected: Quaternion = (0.0, 0.0, 0.0, 1.0)
    for half, axis in halves:  # about z, then the new y, then the new x
        one = [0.0, 0.0, 0.0, math.cos(half)]
        one[axis] = math.sin(half)
        expected = quaternion_product(expected, tuple(one))
    vector = scaled(1.3, (0.6, 0.0, 0.8))
    for name, values, quat in (
        ("euler", yaw_pitch_roll, expected),
        ("axis_angle", vector, quaternion_of(vector)),
        ("quat", scaled(2.0, expected[:3]) + (2.0 * expected[3],), expected),
    ):
        config = motion(3 + len(values), {"rotation_repr": name, "rotation_vec_index": [3, 3 + len(values)]})
        plan = Interpolator(config)
        add(plan, config, [[0], [1], [2], [3], *([each] for each in values)], 0.0)
        assert angle(plan.newest(0.0).pose.quat_xyzw, quat) < 1e-6, name

    def way(**more: Any) -> float:
        turn = {"rotation_repr": "theta", "rotation_vec": [0, 0, 1], "rotation_vec_index": [3], **more}
        config = motion(4, turn)
        plan = Interpolator(config)
        add(plan, config, [[0, 1], *np.zeros((3, 2)), [3.1, -3.1]], 0.0)
        poses = [each.pose.quat_xyzw for each in samples(plan, 0.0, 1.0)]
        return sum(angle(a, b) for a, b in zip(poses, poses[1:]))

    assert way() == pytest.approx(6.2)
    assert way(shortest_path=True) == pytest.approx(2 * math.pi - 6.2)


@pytest.mark.parametrize("seed", SEEDS)
def test_angular_velocity_matches_the_orientations(seed):
    """Against differences of the orientations, with knots up to half a turn apart."""
    rng, h = np.random.default_rng(seed), 1e-4
    knots = [RotationKnot(float(i), random_quat(rng), *(tuple(v) for v in rng.normal(size=(2, 3)))) for i in range(4)]
    path = RotationPath.through(knots)
    for knot in knots[:-1]:
        state = path.sample(knot.time_s)
        assert angle(state.quat_xyzw, knot.quat_xyzw) < 1e-9
        assert state.rate == pytest.approx(knot.rate) and state.acceleration == pytest.approx(knot.acceleration)
    for time_s in rng.uniform(0.01, 2.99, 20):
        before, now, after = (path.sample(time_s + shift) for shift in (-h, 0.0, h))
        rate = scaled(0.5 / h, rotation_between(before.quat_xyzw, after.quat_xyzw))
        acceleration = scaled(0.5 / h, minus(after.rate, before.rate))
        if abs(time_s - round(time_s)) > 2 * h:
            assert now.rate == pytest.approx(rate, rel=1e-4, abs=1e-4)
            assert now.acceleration == pytest.approx(acceleration, rel=1e-3, abs=2e-3)
    for knot in knots[1:-1]:  # the rate at the end of a segment, by differences: it is that of the next one's start
        before = path.sample(knot.time_s - h).rate
        assert before == pytest.approx(knot.rate, abs=0.05)


def refused(act: Callable[[], Any]) -> str:
    with pytest.raises(WaypointError) as error:
        act()
    return str(error.value)


def test_a_wrong_layout_is_named():
    rows, columns = ("rows", 2), ("columns", 3)
    assert waypoint_matrix([rows, columns], [9.0, *range(6)], 1).tolist() == [[0, 1, 2], [3, 4, 5]]
    for layout, data, expected in (
        ([], [], "layout.dim: expected 2 dimensions, 'rows' and 'columns', got 0"),
        ([("row", 2), columns], [], "layout.dim[0].label: expected 'rows', got 'row'"),
        ([rows, ("", 3)], [], "layout.dim[1].label: expected 'columns', got ''"),
        ([rows, columns], [1.0] * 5, "data: expected 2 rows of 3 columns, 6 numbers, got 5"),
    ):
        assert refused(lambda layout=layout, data=data: waypoint_matrix(layout, data)) == expected


def test_wrong_waypoints_are_named():
    config = joints("a", "b")
    for rows, expected in (
        (np.zeros((4, 2)), "layout.dim: expected 3, 5 or 7 rows for motion_dimensions.number 2, and a column at least"),
        (np.zeros((3, 0)), "got 3 and 0"),
        ([[0, 1], [0, math.nan], [0, 0]], "data: expected finite numbers, got nan in row 1, column 1"),
        ([[0, math.inf], [0, 0], [0, 0]], "got inf in row 0, column 1"),
        ([[0, 1, 1], *np.zeros((2, 3))], "expected times that increase (row 0), got 1 s in column 2 after 1 s"),
        ([[1, 0], *np.zeros((2, 2))], "got 0 s in column 1 after 1 s"),
    ):
        assert expected in refused(
            lambda rows=rows: read_waypoints(np.array(rows, dtype=float), config.motion_dimensions)
        )
    zero = np.zeros((8, 2))
    zero[:, 1] = 1.0
    assert refused(lambda: read_waypoints(zero, motion(7, QUAT).motion_dimensions)) == (
        "data: column 0: expected a quaternion that is not zero, got 0, 0, 0, 0"
    )


def test_expired_waypoints_are_refused_and_the_motion_continues():
    config = joints("a", nochange_window_length=20)
    plan = Interpolator(config)
    assert "expected a waypoint to come, the last one is 1 s old" in refused(
        lambda: add(plan, config, [[-2, -1], [0, 1]], 5.0)
    )
    add(plan, config, [[0, 1], [0, 1], [1, 1]], 0.0)
    samples(plan, 0.0, 0.5)
    told = refused(lambda: add(plan, config, [[0, 0.2], [0, 9]], 0.5))
    assert told == (
        "data: expected a waypoint 0.21 s from now or later, after nochange_window_length, 20, and one sample; "
        "the last one is 0.2 s from now"
    )
    assert samples(plan, 0.51, 2.0)[-1].state.position == (1.0,)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"number": 6}, "rotation.rotation_vec_index: expected rows below number, 6, got [3, 7]"),
        ({"trans": {**TRANS, "translation_z_index": 7}}, "trans.translation_z_index: expected a row below number, 7"),
        ({"trans": {"translation_x": 0.0, "translation_y": 1.0}}, "trans.translation_z_index: expected a row below"),
        ({"rotation": {**QUAT, "rotation_vec_index": [3, 6]}}, "expected [i, i + 4] for 'quat', got [3, 6]"),
        ({"rotation": {"rotation_repr": "theta", "rotation_vec_index": [3]}}, "rotation_vec: expected an axis"),
        ({"rotation": {"rotation_repr": "matrix"}}, "rotation_repr"),
        ({"joint_names": ["a"]}, "expected either trans or joint_names"),
        ({"trans": None, "joint_names": ["a", "a"]}, "joint_names: expected 7 names that differ"),
    ],
)
def test_a_wrong_configuration_is_named_with_its_key(change, expected):
    dimensions = {"number": 7, "trans": TRANS, "rotation": QUAT, **change}
    with pytest.raises(ConfigError) as error:
        WaypointMotionConfig.parse({"motion_dimensions": dimensions, "communication": FRAMES}, "traj.yaml")
    assert "traj.yaml: motion_dimensions." in str(error.value) and expected in str(error.value)


def test_limits_that_do_not_fit_are_named_with_their_key():
    for more, expected in (
        ({"limits": {"velocity": [1.0, 2.0, 3.0]}}, "velocity: expected one number, or 2, .* got 3"),
        ({"limits": {"acceleration": 1.0}, "method": "linear"}, "acceleration: expected none with method 'linear'"),
        ({"limits": {"velocity": -1.0}}, "velocity"),
    ):
        with pytest.raises(ConfigError, match=f"interpolation.limits.{expected}"):
            joints("a", "b", **more)


def test_a_frame_needs_its_names():
    dimensions = {"number": 7, "trans": TRANS, "rotation": QUAT}
    with pytest.raises(ConfigError, match="communication.publisher.header_frame_id: expected a TF frame, got none"):
        WaypointMotionConfig.parse({"motion_dimensions": dimensions}, "traj.yaml")
