"""Pushing in the simulator: along paths, with a world unlike the model, a shove, a hidden box and a slow computer."""

from __future__ import annotations

import re
import time

import numpy as np
import pytest

from rpbi_mpc import LockStep
from rpbi_mpc.pushing.config import ProgramConfig, PushingConfig
from rpbi_mpc.pushing.controller import PushingController
from rpbi_mpc.pushing.outcome import ToleranceConfig
from rpbi_mpc.pushing.planar.paths import PathConfig, PushPath
from rpbi_mpc.pushing.planner import ProgramPlanner
from rpbi_mpc.pushing.sampling_planner import PushSamplingConfig, SamplingPlanner
from rpbi_mpc.pushing.simulated import PushingWorld
from rpbi_mpc.pushing.trials import HEIGHT, Variation, pushing_world, run_trial, shove

LINE, S = PathConfig(shape="line", size=0.2), PathConfig(shape="s", size=0.2, angle=0.7)
ARC = PathConfig(shape="arc", size=0.25, angle=0.8)
UNLIKE = Variation(
    seed=901, table=1.3, pusher=0.7, centre=(0.01, -0.01), start=(0.0, 0.008, 0.1), noise_m=0.002, latency_s=0.02
)


def line_loop():
    """Returns a world in which a box is pushed along a line, its plant, and the loop."""
    world = pushing_world(Variation(), PushPath(LINE))
    plant = PushingWorld(world)
    plant.advance(0.05)
    return world, plant, LockStep(plant, PushingController(PushingConfig(path=LINE)))


@pytest.mark.parametrize(
    ("variation", "most_m"),
    [
        pytest.param(Variation(), 0.005, id="model"),
        pytest.param(UNLIKE, 0.015, id="unlike", marks=pytest.mark.thorough),
    ],
)
def test_box_is_pushed_along_an_s(variation, most_m):
    trial = run_trial(PushingConfig(path=S), variation)
    assert trial.finished and trial.errors.mean() < most_m
    assert trial.truth[-1][1:3] == pytest.approx(PushPath(S).poses(1e9)[0, :2], abs=0.02)


def test_a_controller_with_the_other_sign_would_fail():
    """The bounds above can fail: a box that is pushed straight ahead is far from the S."""

    class Straight(ProgramPlanner):
        def _commands(self, solved, gap):
            return np.tile([S.speed, 0.0], (6, 1))

    config = PushingConfig(path=S)
    straight = PushingController(config, Straight(config))
    assert run_trial(config, Variation(), make_controller=lambda _: straight, max_s=6.0).errors.mean() > 0.015


@pytest.mark.thorough
def test_ipopt_alone_does_it_too():
    trial = run_trial(PushingConfig(path=LINE, program=ProgramConfig(solvers=("ipopt",))), Variation(), max_s=2.0)
    assert trial.errors.mean() < 0.005 and all(cycle.status == "solved" for cycle in trial.cycles)


@pytest.mark.thorough
def test_sampled_pushes_follow_a_line_as_predicted():
    config = PushingConfig(path=LINE)
    sampling = PushSamplingConfig(horizon=0.6, seed=903)

    def make_controller(plant):
        return PushingController(config, SamplingPlanner(plant, config, sampling))

    trial = run_trial(config, Variation(seed=903, start=(0.0, 0.005, 0.05)), make_controller=make_controller, max_s=1.4)
    sampled = [cycle for cycle in trial.cycles if cycle.plan and cycle.plan.status == "sampled"][:-1]
    assert trial.errors.mean() < 0.01 and trial.truth[-1][1] > 0.03 and len(sampled) > 20
    happened = [trial.truth[2 * cycle.index + 3, 1:4] for cycle in sampled]
    predicted = [cycle.plan.states[1, :3] for cycle in sampled]
    assert np.allclose(predicted, happened, atol=1e-9), "what the first command does, until the next one acts"


@pytest.mark.parametrize(
    ("path", "variation", "expected"),
    [
        (
            LINE,
            Variation(size=0.6),
            r"the box is 20.\d mm from its goal, .* pushed face is 20.0 mm nearer to its middle",
        ),
        (
            ARC,
            Variation(pusher=0.2),
            r"the box is 1\d.\d mm from its goal, expected at most 5 mm; .* by 2\d % of its speed",
        ),
    ],
    ids=["size", "friction"],
)
def test_a_push_that_misses_its_goal_is_not_finished(path, variation, expected):
    """Judged by the estimate, which follows the model, both would be called finished."""
    trial = run_trial(PushingConfig(path=path), variation)
    assert not trial.finished and trial.cycles[-1].status == "stopped"
    assert re.match(expected, trial.cycles[-1].reason), trial.cycles[-1].reason


def test_a_large_tracking_error_is_not_finished():
    config = PushingConfig(path=LINE, tolerance=ToleranceConfig(tracking=0.0001))
    trial = run_trial(config, Variation(seed=904, noise_m=0.002))
    assert not trial.finished and "mm from the reference on average, expected at most 0.1 mm" in trial.cycles[-1].reason


def test_a_finished_push_reports_a_small_misfit():
    trial = run_trial(PushingConfig(path=LINE), Variation())
    last = trial.cycles[-1]
    assert last.status == "finished" and re.match(r"0.\d mm and 0.\d deg from the goal, .* by 0 % of its", last.reason)


def test_a_shoved_box_comes_back():
    path = PathConfig(shape="line", size=0.35)
    trial = run_trial(PushingConfig(path=path), Variation(seed=902), shove_at_s=1.0, recovered_below=0.01)
    assert trial.errors.max() > 0.015 and trial.recovered_s < 5.0 and trial.finished


@pytest.mark.quick
def test_a_box_far_off_its_path_stops_the_loop():
    """Pushing on would end elsewhere, and be called finished."""
    world, plant, loop = line_loop()
    assert loop.run(1.0)[-1].status == "solved"
    x, y, _ = plant.slider_pose()
    world.act("box", "teleport", {"position": [float(x), float(y) + 0.2, HEIGHT], "quat_xyzw": [0.0, 0.0, 0.0, 1.0]})
    last = loop.run(1.0)[-1]
    assert last.status == "stopped" and last.command is None
    assert last.reason.endswith(" m off its path, max_off is 0.15 m")
    world.close()


def test_decisions_do_not_depend_on_the_speed_of_the_computer():
    class Slow(PushingController):
        def plan(self, sensed, delay_s):
            time.sleep(0.01)
            return super().plan(sensed, delay_s)

    config = PushingConfig(path=LINE)
    quick, slow = (
        run_trial(config, UNLIKE, make_controller=lambda _, kind=kind: kind(config), max_s=1.2)
        for kind in (PushingController, Slow)
    )
    assert np.array_equal(quick.truth, slow.truth)


def test_robot_waits_while_the_box_is_hidden_and_continues_afterwards():
    world, plant, loop = line_loop()
    loop.run(1.0)
    see, plant._see = plant._see, lambda sample: None
    hidden = loop.run(1.0)
    waiting = [each for each in hidden if each.status == "waiting"]
    assert len(waiting) > 20
    assert waiting[-1].reason.startswith("box: no pose for 0.") and "expected one every 0.1 s" in waiting[-1].reason
    stood = plant.slider_pose()
    loop.run(0.2)
    assert np.allclose(plant.slider_pose(), stood, atol=1e-4)
    plant._see = see
    assert loop.run(1.0)[-1].status == "solved"
    assert plant.slider_pose()[0] > stood[0] + 0.02
    world.close()


def test_shove_moves_and_turns_the_box_without_hitting_the_pusher():
    world = pushing_world(Variation(), PushPath(LINE))
    plant, config = PushingWorld(world), PushingConfig(path=LINE)
    for seed in range(10):
        before = plant.slider_pose()
        shove(plant, config, np.random.default_rng(seed))
        after = plant.slider_pose()
        assert abs(np.degrees(np.arctan2(*[f(after[2] - before[2]) for f in (np.sin, np.cos)]))) == pytest.approx(
            30, abs=0.1
        )
        plant.advance(0.02)
        assert np.hypot(*(plant.slider_pose()[:2] - after[:2])) < 0.002, "thrown by the pusher"
    world.close()
