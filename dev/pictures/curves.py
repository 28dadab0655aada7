"""Plots of motions: target streams, inverse kinematics, trajectories, friction, a farm, learning, the tutorial."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from files import give_palette
from plots import new_figure, save
from pushes import example

from custom_ros_tools.config import load_config
from custom_ros_tools.plot_style import BLUE, GREEN, GREY, INK, ORANGE, legend_below
from ik_ros.lookup import make_solver
from ik_ros.problem import IKProblem
from ik_ros.problem_stream import JointRateLimiter, JointRateLimiterConfig, ProblemStream
from robot_model.geometry import Pose
from rpbi.control.trajectories.trajectory import Knot, Trajectory
from rpbi.samples import WrenchSample
from rpbi.world import World
from rpbi_examples.motions import FigureEight
from rpbi_examples.pushing import ball_solver

Array = npt.NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
SWUNG, SWING_RAD, SWING_S, RESTS_S = "lwr_arm_1_joint", 1.0, 4.0, 1.0
"""Joint that swings, its amplitude, the time of a swing, and the time at rest before and after it."""
TARGET_HZ, ZOOM_S = 50.0, (2.0, 2.12)
"""Targets of the swing in a second, and the part of the motion that is also drawn enlarged [s]."""
EIGHT = "{rpbi_examples}/configs/kuka_lwr_ik_example"
EIGHT_FRAME = Pose((-0.2, 0.0, 0.6), (math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0))
"""Frame of the figure eight in the world, as in the launch file."""
POINTS = (
    (0.0, 0.0, 0.0, 0.0),
    (1.0, 0.6, 0.9, 0.0),
    (2.0, 1.4, 0.3, -0.8),
    (3.0, 1.0, -0.5, 0.0),
    (4.0, 0.8, 0.0, 0.0),
)
"""Times [s] of a trajectory's points, with position [rad], velocity [rad/s] and acceleration [rad/s^2]."""
START_M_S, CHANGE_S, SLIDES_S = 2.0, 0.1, 1.0
"""First speed of the sliding box [m/s], time of the change of its friction, and time that the plot shows [s]."""
EPISODES, EPISODE_S = 20, 2.0
"""Number of the farm's episodes, and their longest duration [s]."""
EQUAL_MM, EQUAL_AFTER_S = 0.1, 0.2
"""Largest difference of errors that are drawn as one line [mm], except just after the target has begun to move [s]."""
BESIDE: Mapping[str, Any] = {"textcoords": "offset points", "weight": "bold"}
"""Style of texts at lines."""
IK_HZ, SHOWN_S, SETTLES_S = 100.0, 20.0, 3.0
"""Problems in a second, time that the plot shows, and time in which the arm moves to the start of the figure [s]."""


def draw_streams(path: Path) -> None:
    """Draws effort and wrist force of an arm that follows a target stream by steps, and smoothly."""
    figure, axes = new_figure(2, 2, (9.6, 5.2), sharex="col", width_ratios=(1.5, 1.0))
    for name, colour in (("hold", ORANGE), ("smooth", BLUE)):
        rows = _swung(name)
        labels = {"hold": "hold: each target is a step", "smooth": "smooth, the default"}
        for column, part in enumerate((rows, rows[(rows[:, 0] > ZOOM_S[0]) & (rows[:, 0] < ZOOM_S[1])])):
            for quantity in (1, 2):
                width = 2.0 if column or name == "smooth" else 0.6
                axes[2 * (quantity - 1) + column].plot(
                    part[:, 0], part[:, quantity], color=colour, lw=width, label=labels[name]
                )
    begin_s, end_s = ZOOM_S
    axes[0].set(title="one swing of joint 1", ylabel="effort of joint 1 [N m]")
    axes[1].set(title=f"enlarged: {1e3 * (end_s - begin_s):.0f} ms, with {(end_s - begin_s) * TARGET_HZ:.0f} targets")
    axes[2].set(xlabel="time [s]", ylabel="force in the wrist, x [N]")
    axes[3].set(xlabel="time [s]")
    for each in axes[::2]:
        each.axvspan(begin_s, end_s, color=GREY, alpha=0.4, lw=0)
    legend_below(figure, axes[3], 2)
    save(figure, path)


def draw_ik_errors(path: Path) -> None:
    """Draws the distance between tip and moving target over time, for three solvers with equal errors, and trac_ik."""
    figure, (axes,) = new_figure(1, 1, (9.0, 4.2))
    errors_mm = {name: _followed(name) for name in ("kdl", "pybullet", "tasks", "trac_ik")}
    times_s, equal_mm = errors_mm["kdl"]
    for name in ("pybullet", "tasks"):
        differences = np.abs(errors_mm[name][1] - equal_mm)[times_s > EQUAL_AFTER_S]
        assert differences.max() < EQUAL_MM, f"{name} differs by {differences.max():.2f} mm from kdl"
    axes.plot(*errors_mm["trac_ik"], color=ORANGE, lw=1.2)
    axes.plot(times_s, equal_mm, color=BLUE, lw=2.6)
    highest = int(np.argmax(errors_mm["trac_ik"][1]))
    peak, side = (times_s[highest], errors_mm["trac_ik"][1][highest]), "left" if times_s[highest] < 9.0 else "right"
    offset = 8 if side == "left" else -8, -4
    axes.annotate("trac_ik: peaks where it changes posture", peak, offset, color=ORANGE, ha=side, **BESIDE)
    axes.annotate("kdl, pybullet and tasks: equal", (times_s[-1], 0.9), (-220, 0), color=BLUE, **BESIDE)
    axes.set(ylim=(0.0, None), xlim=(0.0, SHOWN_S), xticks=range(0, round(SHOWN_S) + 1, 2))
    axes.set(xlabel="time since the target began to move [s]", ylabel="distance from tip to target [mm]")
    save(figure, path)


def draw_gym_curve(path: Path) -> None:
    """Draws the learning curve of the example that learns to reach."""
    from rpbi_examples.gym import train_reach

    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / path.name
        subprocess.run(["python3", "-m", train_reach.__name__, "--out", out], check=True)
        shutil.copyfile(out, path)
    give_palette(path)


def draw_trajectories(path: Path) -> None:
    """Draws position and velocity of a joint through the same points, with and without velocities and accelerations."""
    figure, (position, velocity) = new_figure(2, 1, (8.6, 5.0), sharex=True)
    times_s = np.linspace(0.0, POINTS[-1][0], 600)
    for label, count, style in (("positions only: lines", 0, "--"), ("with velocities: cubics", 1, "-"),
                                ("and accelerations: quintics", 2, "-")):  # fmt: skip
        knots = [Knot(at_s, *((each,) for each in values[: count + 1])) for at_s, *values in POINTS]
        states = [Trajectory.through(knots).sample(float(each)) for each in times_s]
        position.plot(times_s, [each.position[0] for each in states], style, label=label)
        velocity.plot(times_s, [each.velocity[0] for each in states], style, label=label)
    position.plot([each[0] for each in POINTS], [each[1] for each in POINTS], "o", color=INK, label="points")
    position.set_ylabel("position [rad]")
    velocity.set(ylabel="velocity [rad/s]", xlabel="time [s]")
    legend_below(figure, position, 4)
    save(figure, path)


def draw_dynamics(path: Path) -> None:
    """Draws the speed of a box that slides over the floor, while a call changes its friction."""
    figure, (axes,) = new_figure(1, 1, (8.6, 3.6))
    for friction, colour, words, at in (
        (0.7, GREY, "friction stays at 0.7", (0.275, 0.1)),
        (0.1, BLUE, "friction lowered from 0.7 to 0.1", (0.42, 1.02)),
    ):
        with tempfile.TemporaryDirectory(prefix="rpbi-") as folder:
            keys = {"resetBaseVelocity": {"linearVelocity": [-START_M_S, 0.0, 0.0]}}
            world = example(Path(folder), box=keys)
            box: Any = world.bodies["box"]
            rows = []
            while world.clock.time_s < SLIDES_S:
                if world.clock.tick == round(CHANGE_S / world.config.timeStep):
                    world.change_dynamics("box", {"lateralFriction": friction})
                world.step()
                rows.append((world.clock.time_s, np.linalg.norm(box.pb.getBaseVelocity(box.body_id)[0][:2])))
            world.close()
        axes.plot(*np.transpose(rows), color=colour, lw=2.4, clip_on=False)
        axes.annotate(words, at, (8, 4), color=colour, **BESIDE)
    axes.axvline(CHANGE_S, color=ORANGE, lw=1.2, ls="--")
    axes.annotate("change_dynamics is called", (CHANGE_S, START_M_S), (6, -4), textcoords="offset points", color=ORANGE)
    axes.set(xlabel="time [s]", ylabel="speed of the box [m/s]", ylim=(0.0, None), xlim=(0.0, SLIDES_S))
    save(figure, path)


def draw_farm(path: Path) -> None:
    """Draws the paths of the box in the episodes of docs/farm.md, seen from above."""
    text = (ROOT / "docs/farm.md").read_text(encoding="utf-8")
    scope: dict[str, Any] = {}
    exec(re.search(r"```python\n(.*?)```", text, re.DOTALL)[1], scope)  # type: ignore[index]  # the page's own policy
    figure, (axes,) = new_figure(1, 1, (7.0, 5.6))
    for number in range(EPISODES):
        world = World.from_file("{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml")
        policy, label = scope["Push"](world, np.random.default_rng(number)), None
        places = []
        while label is None and world.clock.time_s < EPISODE_S:
            label = policy.act()
            world.step()
            places.append(world.bodies["box"].base_pose().position[:2])
        world.close()
        x, y = np.transpose(places)
        axes.plot(y, x, color=GREEN if label else GREY, lw=1.6)
        axes.plot(y[0], x[0], "o", color=GREEN if label else GREY, ms=4)
    axes.axvline(-0.3, color=INK, lw=1.2, ls="--")
    for colour, label in ((GREEN, "success"), (GREY, "timeout")):
        axes.plot([], [], "o-", color=colour, label=label)
    axes.plot([], [], "--", color=INK, lw=1.2, label="limit of success")
    axes.set(xlabel="y of the box [m]", ylabel="x of the box [m]", aspect="equal")
    legend_below(figure, axes, 3)
    save(figure, path)


def draw_slow(path: Path) -> None:
    """Draws the table of docs/slow.md with the computing time of a tick by the contents of the world."""
    text = (ROOT / "docs/slow.md").read_text(encoding="utf-8")
    table = text[text.index("| world | computing time") :].split("\n\n")[0]
    rows = re.findall(r"^\| ([^|]+) \| ([\d.]+) \|$", table, re.MULTILINE)
    names, times = zip(*((name.replace("`", ""), float(value)) for name, value in reversed(rows)))
    figure, (axes,) = new_figure(1, 1, (8.6, 2.8))
    axes.bar_label(axes.barh(names, times, color=BLUE), padding=4)
    axes.grid(axis="y", visible=False)
    axes.set(xlabel="computing time of a tick, relative to the first row")
    save(figure, path)


def draw_talos_push(path: Path) -> None:
    """Draws the table of docs/example_talos.md, which took hours to measure."""
    from rpbi_examples.balance.largest_push import draw, pushes_in

    draw(pushes_in((ROOT / "docs/example_talos.md").read_text(encoding="utf-8")), path)
    give_palette(path)


def draw_tutorial_path(path: Path) -> None:
    """Draws the path of the box that the tutorial lifts, by the commands and scripts of its page."""
    page = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")
    import rospy
    from screen import Stage, wait_until

    with Stage() as stage, tempfile.TemporaryDirectory() as folder:
        for text, name in re.findall(r"```(?:yaml|python)\n(# (\S+).*?)```", page, flags=re.DOTALL):
            (Path(folder) / name).write_text(text, encoding="utf-8")
        stage.launch("world.launch", f"config:={folder}/world.yaml", "headless:=true")
        wait_until(lambda: "/rpbi/box/base_state" in dict(rospy.get_published_topics()), "the box is there")
        for script in ("lift.py", "path.py"):
            subprocess.run(["python3", script], cwd=folder, env=os.environ, check=True)
        shutil.copyfile(Path(folder) / "path.png", path)
    give_palette(path)


def _swung(interpolation: str) -> Array:
    """Returns for each tick the time [s], the effort of the swinging joint [N m] and the force in the wrist, x [N]."""
    keys: Mapping[str, Any] = {"target_interpolation": interpolation, "target_buffer_s": 0.0}
    rows, force_n = [], math.nan
    with tempfile.TemporaryDirectory(prefix="rpbi-") as folder:
        world = example(Path(folder), 0.002, kuka_lwr=keys)
        arm: Any = world.bodies["kuka_lwr"]
        names, index = [joint.name for joint in arm.model.moving], arm.model[SWUNG].index
        start = dict(zip(names, arm.joint_positions().values()))
        every = round(1.0 / (TARGET_HZ * world.config.timeStep))
        for tick in range(round((SWING_S + 2.0 * RESTS_S) / world.config.timeStep)):
            time_s = tick * world.config.timeStep
            if tick % every == 0:
                share = min(max((time_s - RESTS_S) / SWING_S, 0.0), 1.0)
                swing = SWING_RAD * 0.5 * (1.0 - math.cos(2.0 * math.pi * share))
                world.put("kuka_lwr/target", {**start, SWUNG: start[SWUNG] - swing})
            for sample in world.step():
                if isinstance(sample, WrenchSample):
                    force_n = sample.force[0]
            rows.append((time_s, arm.pb.getJointState(arm.body_id, index)[3], force_n))
        world.close()
    return np.array(rows)


def _followed(solver_name: str) -> tuple[Array, Array]:
    """Returns times [s], and the distances of an arm's tip from a target on the figure eight [mm]."""
    solver: Any = make_solver(solver_name, load_config(f"{EIGHT}/{solver_name}.yaml"))
    limiter = JointRateLimiter(JointRateLimiterConfig(hold=True), solver.joint_names, solver.velocity_limits)
    stream = ProblemStream(solver, limiter)
    world, chain = World.from_file(f"{EIGHT}/config.yaml"), ball_solver().chain
    arm: Any = world.bodies["kuka_lwr"]
    base, eight = arm.base_pose(), FigureEight()
    ticks, rows = round(1.0 / (IK_HZ * world.config.timeStep)), []
    start = dict(zip([joint.name for joint in arm.model.moving], arm.joint_positions().values()))
    for number in range(round((SETTLES_S + SHOWN_S) * IK_HZ)):
        time_s = number / IK_HZ - SETTLES_S
        target = base.inverse() @ EIGHT_FRAME @ Pose(eight.position(max(time_s, 0.0)))
        stream.solve(IKProblem(target, start={} if number else start), 1.0 + time_s + SETTLES_S)
        world.put("kuka_lwr/target", dict(zip(solver.joint_names, stream.target or ())))
        for _ in range(ticks):
            world.step()
        if time_s >= 0.0:
            at_s = time_s + 1.0 / IK_HZ
            goal = base.inverse() @ EIGHT_FRAME @ Pose(eight.position(at_s))
            tip = chain.pose(list(arm.joint_positions().values()))
            rows.append((at_s, 1e3 * math.dist(tip.position, goal.position)))
    world.close()
    times_s, distances_mm = np.array(rows).T
    return times_s, distances_mm
