"""Pictures that reports of examples draw: forces of the demo, a press by a haptic device, a push and wiping."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Iterator
from itertools import cycle
from pathlib import Path
from typing import Any, cast

import pandas as pd
from files import give_palette
from screen import PATIENCE_S, Stage

from rpbi.samples import ContactsSample, WrenchSample
from rpbi.world import World
from rpbi_examples.demo_report import plot_forces
from rpbi_examples.motions import PlanarPose
from rpbi_examples.pushing import PLACES, Pusher, ball_solver, next_push
from rpbi_examples.scenes.task import SceneTask, make_env, run_episode
from rpbi_examples.scenes.wiping import Wiping
from rpbi_examples.scenes.wiping_plot import draw as draw_wiping

DEMO = "{rpbi_examples}/configs/basic_example_kuka_lwr/config.yaml"
WIPING_SEED = 212
TARGET_HZ = 50.0
FRICTION = 0.7
"""Friction coefficient of box and floor."""
PACE = 0.3
"""Real-time factor of learning from demonstration, so that no target is late on a busy machine."""
SHOWN_S = 11.0
"""Duration of the demo in the picture, in which the arm pushes twice [s]."""


def draw_forces(path: Path) -> None:
    """Draws the forces on the box and in the wrist while the arm of the demo pushes the box forth and back."""
    world = World.from_file(DEMO)
    forces, wrist = [], []
    for targets in _pushes(world):
        world.put("kuka_lwr/target", targets)
        for _ in range(round(1.0 / (TARGET_HZ * world.config.timeStep))):
            samples = world.step()
            time_s = world.clock.tick * world.config.timeStep
            for sample in samples:
                if isinstance(sample, ContactsSample) and sample.name == "box":
                    forces.append((time_s, *(_normal_n(sample, body) for body in ("kuka_lwr", "floor"))))
                if isinstance(sample, WrenchSample):
                    wrist.append((time_s, *sample.force))
        if time_s > SHOWN_S:
            break
    world.close()
    table = pd.DataFrame(forces, columns=["time", "push", "floor"]).set_index("time")
    columns = ["time", *(f"wrench/force/{axis}" for axis in "xyz")]
    sensor = pd.DataFrame(wrist, columns=columns).set_index("time")
    plot_forces(table["push"], FRICTION * table["floor"], sensor, 0.0, path)
    give_palette(path)


def draw_press(path: Path) -> None:
    """Draws the figure that the example `human_interaction` writes after the press of the scripted hand."""
    with tempfile.TemporaryDirectory(prefix="rpbi-") as folder, Stage() as stage:
        arguments = ("device:=scripted", "headless:=true", f"output:={folder}")
        stage.launch("human_interaction.launch", *arguments).wait(PATIENCE_S)
        shutil.copyfile(Path(folder) / "human_interaction.png", path)
    give_palette(path)


def draw_lfd_pipeline(path: Path) -> None:
    """Draws the stages of a scripted run of the example `lfd`."""
    with tempfile.TemporaryDirectory(prefix="rpbi-") as folder, Stage() as stage:
        arguments = ("operator:=scripted", "seed:=3", "headless:=true", f"out:={folder}", f"real_time_factor:={PACE}")
        stage.launch("lfd.launch", *arguments).wait(PATIENCE_S)
        shutil.copyfile(Path(folder) / "pipeline.png", path)
    give_palette(path)


def draw_pushing_report(path: Path) -> None:
    """Draws one of the pictures that the example `pushing_mpc` writes at the end of a push, by the name of the file."""
    with tempfile.TemporaryDirectory(prefix="rpbi-") as folder, Stage() as stage:
        stage.launch("pushing_mpc.launch", "headless:=true", f"out:={folder}").wait(PATIENCE_S)
        shutil.copyfile(Path(folder) / path.name.removeprefix("pushing_"), path)
    give_palette(path)


def draw_wiping_force(path: Path) -> None:
    """Draws force and wiped area of an episode of the scene `wiping`, as docs/example_wiping.md has it."""
    env = make_env("wiping")
    result = run_episode(env, WIPING_SEED)
    draw_wiping(cast(Wiping, cast(SceneTask, env.task).scene), result, f"wiping, seed {WIPING_SEED}", path)
    env.close()
    give_palette(path)


def _pushes(world: World) -> Iterator[dict[str, float]]:
    """Yields the targets of the arm's joints, `TARGET_HZ` of them in a second, while the arm pushes forth and back."""
    solver = ball_solver()
    pusher = Pusher(solver)
    arm, box = (_body(world, name) for name in ("kuka_lwr", "box"))
    positions = tuple(arm.joint_positions().values())
    for goal in cycle(PLACES):
        (x, y, _), quat = arm.base_pose().inverse() @ box.base_pose()
        push = next_push(PlanarPose(x, y, 2.0 * math.atan2(quat[2], quat[3])), goal)
        for move in pusher.moves(positions, push) if push else ():
            count = round(move.duration_s * TARGET_HZ)
            for number in range(1, count + 1):
                positions = move.at(number / count * move.duration_s)
                yield dict(zip(solver.joint_names, positions))


def _body(world: World, name: str) -> Any:
    return world.bodies[name]


def _normal_n(sample: ContactsSample, body: str) -> float:
    """Returns the sum of the normal forces of another body [N]."""
    return sum(point.normal_force for point in sample.points if point.other_body == body)
