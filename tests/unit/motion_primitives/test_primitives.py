"""Properties of the primitives: where motions start, go and end, and how they keep their shape."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shown_motions import random_pose, reach, stir

from motion_primitives import PRIMITIVES, Demonstration, ViaPoint, make_primitive
from motion_primitives.errors import GoalNotReachedError, NotLearnedError, PlanError
from motion_primitives.primitive import MotionPlan

SHOWN = [reach(seed) for seed in range(5)]
DISCRETE = ("dmp", "promp")
LEARNED = {name: make_primitive(name, {}).learn(SHOWN) for name in DISCRETE}
STIRRING = make_primitive("rhythmic_dmp", {}).learn(stir())


def angles_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (Rotation.from_quat(a) * Rotation.from_quat(b).inv()).magnitude()


def check_velocities(plan: MotionPlan, tolerance: float) -> None:
    """Checks that velocities are those of the points, which cannot be if one jumps."""
    measured = plan.space.rates(plan.times, plan.points)
    assert plan.velocities[2:-2] == pytest.approx(measured[2:-2], abs=tolerance)


@pytest.mark.parametrize("name", DISCRETE)
def test_learning_five_demonstrations_of_ten_seconds(name, capsys):
    begin_s = time.perf_counter()
    make_primitive(name, {}).learn(SHOWN)
    with capsys.disabled():
        print(f"\n{name}: {time.perf_counter() - begin_s:.3f} s to learn 5 demonstrations of 10 s at 100 Hz")


@pytest.mark.parametrize("name, metres, radians", [("dmp", 1e-4, 1e-3), ("promp", 2e-3, 5e-3)])
def test_a_demonstration_is_repeated(name, metres, radians):
    plan = make_primitive(name, {}).learn(SHOWN[0]).plan(SHOWN[0].points[0], SHOWN[0].points[-1])
    assert plan.duration_s == pytest.approx(10.0)
    assert plan.positions == pytest.approx(SHOWN[0].points[:, :3], abs=metres)
    assert angles_between(plan.quats_xyzw, SHOWN[0].points[:, 3:]).max() < radians


@pytest.mark.parametrize("name", DISCRETE)
@pytest.mark.parametrize("seed", range(8))
def test_any_start_and_goal_in_time_without_a_jump(name, seed):
    rng = np.random.default_rng(seed)
    start, goal, duration_s = random_pose(rng), random_pose(rng), float(rng.uniform(1.0, 20.0))
    plan = LEARNED[name].plan(start, goal, duration_s, dt_s=duration_s / 500)
    assert plan.duration_s == pytest.approx(duration_s, rel=1e-9)
    for index, end in ((0, start), (-1, goal)):
        assert plan.positions[index] == pytest.approx(end[:3], abs=1e-5)
        assert angles_between(plan.quats_xyzw[index], end[3:]) < 1e-4
    assert plan.velocities[[0, -1]] == pytest.approx(0.0, abs=1e-3 / duration_s)
    check_velocities(plan, 5e-3 / duration_s)


@pytest.mark.parametrize("name", DISCRETE)
def test_positions_and_orientations_share_their_phase(name):
    """An orientation that was shown in proportion to a position stays in proportion, whatever the duration."""
    times = np.linspace(0.0, 4.0, 401)
    share = np.sin(np.linspace(0.0, 0.5 * np.pi, 401)) ** 2
    quats = Rotation.from_rotvec(np.outer(share, [0.0, 0.0, 1.0])).as_quat()
    shown = Demonstration.of(times, np.outer(share, [1.0, 0.0, 0.0]), quats)
    plan = make_primitive(name, {}).learn(shown).plan(duration_s=7.0)
    angles = 2.0 * np.arctan2(plan.quats_xyzw[:, 2], plan.quats_xyzw[:, 3])
    assert angles == pytest.approx(plan.positions[:, 0], abs=2e-3 if name == "promp" else 1e-9)


@pytest.mark.parametrize("name", DISCRETE)
def test_a_shifted_demonstration_leads_to_a_shifted_motion(name):
    shift = np.array([3.0, -2.0, 1.0])
    moved = [Demonstration.of(each.times, each.points[:, :3] + shift, each.points[:, 3:]) for each in SHOWN]
    plan = make_primitive(name, {}).learn(moved).plan()
    assert plan.positions - shift == pytest.approx(LEARNED[name].plan().positions, abs=1e-6)


@pytest.mark.parametrize("name", DISCRETE)
def test_the_path_does_not_depend_on_the_duration(name):
    slow, fast = (LEARNED[name].plan(duration_s=each, dt_s=each / 200) for each in (20.0, 2.0))
    assert slow.points == pytest.approx(fast.points, abs=1e-9)
    assert 10.0 * slow.velocities == pytest.approx(fast.velocities, abs=1e-8)


@pytest.mark.parametrize("name", DISCRETE)
@pytest.mark.parametrize("progress", [0.1, 0.5, 0.8])
def test_goal_can_change_during_the_motion(name, progress):
    goal = [0.6, 0.2, 0.5, 0.0, math.sin(0.4), 0.0, math.cos(0.4)]
    execution, states = LEARNED[name].begin(goal=SHOWN[0].points[-1], duration_s=5.0), []
    for step in range(525):
        if step == int(500 * progress):
            execution.set_goal(goal)
        states.append(execution.step(0.01))
    assert execution.end_s == pytest.approx(5.25 if (name, progress) == ("dmp", 0.8) else 5.0)
    assert execution.is_at_goal()
    times, points, velocities = (np.array(each) for each in zip(*states))
    assert np.abs(np.diff(velocities, axis=0)).max() < 0.2
    check_velocities(MotionPlan(execution.space, times, points, velocities), 0.02)


def test_a_goal_that_changes_after_the_end_is_reached_too():
    execution = LEARNED["dmp"].begin(duration_s=4.0)
    for _ in range(500):
        execution.step(0.01)
    execution.set_goal(random_pose(np.random.default_rng(0)))
    assert execution.end_s == pytest.approx(6.0) and not execution.is_at_goal()
    for _ in range(101):
        execution.step(0.01)
    assert execution.is_at_goal()


def test_it_is_too_late_for_another_goal():
    execution = LEARNED["promp"].begin(duration_s=1.0)
    for _ in range(95):
        execution.step(0.01)
    with pytest.raises(PlanError, match="goal: expected a change before 90% of the duration, got one after 95%"):
        execution.set_goal(SHOWN[0].points[-1])


@pytest.mark.parametrize("name", DISCRETE)
def test_it_starts_with_the_velocity_that_it_has(name):
    velocity = [0.1, 0.0, -0.1, 0.2, 0.0, 0.0]
    plan = LEARNED[name].plan(start=SHOWN[0].points[0], velocity=velocity)
    assert plan.velocities[0] == pytest.approx(velocity, abs=1e-5)
    check_velocities(plan, 0.02)


def test_joints():
    shown = reach(orientation=False)
    joints = Demonstration.of(shown.times, shown.points, names=["shoulder", "elbow", "wrist"])
    plan = make_primitive("dmp", {}).learn(joints).plan(goal=[0.0, 0.5, -0.5])
    assert plan.space.point_names == ("shoulder", "elbow", "wrist") and plan.quats_xyzw is None
    assert plan.points[-1] == pytest.approx([0.0, 0.5, -0.5], abs=1e-6)


def test_a_fixed_goal_is_reached_later():
    primitive = make_primitive("dmp", {"attractor": "fixed"}).learn(SHOWN)
    goal = random_pose(np.random.default_rng(3))
    plan = primitive.plan(goal=goal)
    assert 10.0 < plan.duration_s < 30.0
    assert plan.positions[-1] == pytest.approx(goal[:3], abs=1e-3)
    check_velocities(plan, 5e-3)


def test_a_goal_that_is_kept_from_being_reached():
    push = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    with pytest.raises(GoalNotReachedError, match=r"goal: missed by .* after 15.* s, expected at most 0.001"):
        LEARNED["dmp"].plan(duration_s=5.0, dt_s=0.05, couplings=[lambda state, spring: push])


# --- Via-points


def test_via_points_are_passed():
    primitive = LEARNED["promp"]
    rng = np.random.default_rng(0)
    for progress in (0.2, 0.5, 0.7):
        mean, _ = primitive.mean_at(primitive.distribution, progress)
        shift = primitive.stds([progress])[0] * rng.uniform(-1.5, 1.5, 6)
        via = ViaPoint(progress, primitive.space.plus(mean, shift))
        plan = primitive.plan(via_points=[via])
        at = plan.points[round(progress * (len(plan.times) - 1))]
        assert at[:3] == pytest.approx(via.point[:3], abs=1e-3) and angles_between(at[3:], via.point[3:]) < 2e-3
        check_velocities(plan, 5e-3)


def test_via_point_reduces_the_spread_near_it():
    primitive, looks = LEARNED["promp"], np.linspace(0.0, 1.0, 21)
    given = primitive.conditioned([ViaPoint(0.5, SHOWN[1].points[500], 1e-4)])
    free, left = primitive.stds(looks), primitive.stds(looks, given)
    assert (left <= free + 1e-12).all()
    assert left[10] == pytest.approx(1e-4, rel=0.01) and (left[9] < 0.9 * free[9]).all()


def test_spread_equals_that_of_the_demonstrations():
    free = make_primitive("promp", {"prior": 1e-6}).learn(SHOWN)
    shown = np.std([each.points[500, :3] for each in SHOWN], axis=0)
    assert free.stds([0.5])[0, :3] == pytest.approx(shown, rel=0.05)


@pytest.mark.parametrize("samples", [10, 15, 20, 201])
@pytest.mark.parametrize("at_rest", [True, False])
def test_promp_keeps_shown_ends_with_few_samples(samples, at_rest):
    """With fewer samples than basis functions a motion left the shown one by 0.72 m, and its goal by 11 mm."""
    times = np.linspace(0.0, 2.0, samples)
    u = times / 2.0
    share = 10 * u**3 - 15 * u**4 + 6 * u**5 if at_rest else u
    shown = np.outer(share, [0.4, 0.2, -0.1]) + [1.0, 0.0, 0.3]
    plan = make_primitive("promp", {}).learn(Demonstration.of(times, shown)).plan()
    assert plan.positions[[0, -1]] == pytest.approx(shown[[0, -1]], abs=1e-4)
    near = np.stack([np.interp(plan.times, times, column) for column in shown.T], axis=1)
    assert plan.positions == pytest.approx(near, abs=0.02 if at_rest else 0.08)  # it starts and ends at rest


def via_points(gap: float, apart: float) -> list[ViaPoint]:
    """Returns two via-points near each other on a demonstration, the second one shifted [m]."""
    shifted = SHOWN[0].points[round(1000 * (0.5 + gap))] + [0.0, 0.0, apart, 0.0, 0.0, 0.0, 0.0]
    return [ViaPoint(0.5, SHOWN[0].points[500]), ViaPoint(0.5 + gap, shifted)]


def test_promp_refuses_plans_far_from_demonstrations():
    assert LEARNED["promp"].plan(via_points=via_points(0.001, 0.0)).positions[:, 2].max() < 0.7
    with pytest.raises(PlanError, match=r"plan: expected . from .* within 2 shown extents \(option 'reach'\)"):
        LEARNED["promp"].plan(via_points=via_points(0.001, 0.1))
    with pytest.raises(PlanError, match=r"goal: expected x from .* got 5 at 10 s"):
        LEARNED["promp"].plan(goal=[5.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0])
    far = make_primitive("promp", {"reach": 20.0}).learn(SHOWN)
    assert far.plan(goal=[5.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0]).positions[-1] == pytest.approx([5.0, 0.0, 0.3], abs=1e-3)


def test_promp_refuses_missed_points():
    point = SHOWN[0].points[500]
    other = point + [0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    with pytest.raises(PlanError, match=r"via_points\[0\]: expected to be passed within 0.00103 m .* a miss by 0.01"):
        LEARNED["promp"].plan(via_points=[ViaPoint(0.5, point), ViaPoint(0.5, other)])
    LEARNED["promp"].plan(via_points=[ViaPoint(0.5, point, 0.01), ViaPoint(0.5, other, 0.01)])


def test_promp_keeps_its_motion_when_a_new_goal_is_refused():
    execution = LEARNED["promp"].begin(duration_s=2.0)
    for _ in range(100):
        execution.step(0.01)
    with pytest.raises(PlanError, match="'reach'"):
        execution.set_goal([5.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0])
    for _ in range(100):
        execution.step(0.01)
    assert execution.is_at_goal()


# --- Rhythms


def test_the_period_is_found():
    assert STIRRING.period_s == pytest.approx(1.7, rel=1e-5)


def test_a_rhythm_is_repeated():
    plan = STIRRING.plan()
    assert plan.duration_s == pytest.approx(8.3)
    assert plan.positions == pytest.approx(stir().points[:, :3], abs=1e-3)
    assert angles_between(plan.quats_xyzw, stir().points[:, 3:]).max() < 2e-3


def test_demonstrations_of_a_rhythm_may_begin_anywhere_in_it():
    primitive = make_primitive("rhythmic_dmp", {}).learn([stir(), stir(ahead=0.3)])
    assert primitive.plan().positions == pytest.approx(stir().points[:, :3], abs=1e-3)


@pytest.mark.parametrize("amplitude, period_s", [(0.5, 0.8), (2.0, 3.0)])
def test_amplitude_period_and_centre_are_free(amplitude, period_s):
    primitive = make_primitive("rhythmic_dmp", {}).learn(stir())
    primitive.amplitude, primitive.period_s = amplitude, period_s
    plan = primitive.plan(goal=[1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0], duration_s=4.0 * period_s, dt_s=period_s / 100)
    x = plan.positions[:, 0] - 1.0
    assert [x.min(), x.max()] == pytest.approx([-0.1 * amplitude, 0.1 * amplitude], rel=0.02)
    assert plan.points[100:] == pytest.approx(plan.points[:-100], abs=1e-4)
    assert np.abs(plan.positions[50:] - plan.positions[:-50]).max() > 0.1 * amplitude
    check_velocities(plan, 0.02 * amplitude / period_s)


def test_a_rhythm_is_found_from_anywhere():
    far = [2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    plan = STIRRING.plan(start=far, duration_s=8.5)
    assert plan.positions[0] == pytest.approx(far[:3])
    assert plan.positions[-100:] == pytest.approx(STIRRING.plan(duration_s=8.5).positions[-100:], abs=1e-4)


def test_rhythm_can_change_during_the_motion():
    execution = STIRRING.begin(duration_s=60.0)
    for _ in range(200):
        execution.step(0.01)
    execution.period_s, execution.amplitude = 1.0, 0.3
    execution.set_goal([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    states = [execution.step(0.01) for _ in range(500)]
    y = np.array([state.point[1] for state in states[200:]])
    assert y.mean() == pytest.approx(1.0, abs=1e-3) and np.ptp(y) == pytest.approx(0.3 * 0.1, rel=0.05)
    assert y[100:] == pytest.approx(y[:-100], abs=1e-6)


# --- Requests that make no sense


@pytest.mark.parametrize("name", PRIMITIVES)
def test_nothing_is_planned_before_it_has_learned(name):
    for call in ("plan", "begin", "learned"):
        with pytest.raises(NotLearnedError, match="learned nothing yet"):
            getattr(make_primitive(name, {}), call)()


@pytest.mark.parametrize(
    "request_, text",
    [
        ({"start": [1.0, 2.0]}, "start: expected 7 finite numbers x, y, z, qx, qy, qz, qw"),
        ({"goal": [math.nan] * 7}, "goal: expected 7 finite numbers"),
        ({"goal": ["a"]}, "goal: expected 7 finite numbers"),
        ({"goal": [0.0] * 7}, "goal: expected a quaternion of length 1, got length 0"),
        ({"duration_s": 0.0}, "duration: expected a finite time above 0 s, got 0.0"),
        ({"duration_s": math.inf}, "duration: expected a finite time"),
        ({"dt_s": -1.0}, "dt: expected a time step above 1e-05 s, got -1.0"),
        ({"dt_s": 1e-9}, "dt: expected a time step above 1e-05 s, got 1e-09"),
        ({"velocity": [0.0]}, "velocity: expected 6 finite numbers"),
    ],
)
@pytest.mark.parametrize("name", DISCRETE)
def test_a_request_that_makes_no_sense(name, request_, text):
    with pytest.raises(PlanError, match=text):
        LEARNED[name].plan(**request_)


def test_via_points_that_make_no_sense():
    point = SHOWN[0].points[0]
    for via, text in (
        (ViaPoint(1.5, point), r"via_points\[0\].progress: expected a share of the duration from 0 to 1, got 1.5"),
        (ViaPoint(0.5, point, -1.0), r"via_points\[0\].std"),
        (ViaPoint(0.5, [1.0]), r"via_points\[0\]: expected 7 finite numbers"),
    ):
        with pytest.raises(PlanError, match=text):
            LEARNED["promp"].plan(via_points=[via])
    with pytest.raises(PlanError, match="via_points: expected none, since this primitive does not support them, got 1"):
        LEARNED["dmp"].plan(via_points=[ViaPoint(0.5, point)])
    with pytest.raises(PlanError, match="period: expected a finite time above 0 s, got 0"):
        STIRRING.period_s = 0
