"""Picture of the guard: a simulated arm is driven at a table and into itself, without the guard and with it."""

from __future__ import annotations

import random
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pybullet
import yaml
from matplotlib.axes import Axes
from plots import BAD, GOOD, new_figure, save, show
from render import Photographer

from robot_model.collision.distances import Pair
from robot_model.model import RobotModel
from rpbi.world import World
from safe_robot.check import CheckContext
from safe_robot.checks.environment import Environment
from safe_robot.checks.self_collision import SelfCollision
from safe_robot.config import GuardConfig
from safe_robot.guard import Guard

Array = npt.NDArray[np.float64]

LWR = str(Path(__file__).resolve().parents[2] / "src/rpbi_examples/robots/kuka_lwr.urdf")
PERIOD_S, DURATION_S, SHOWN_S = 0.01, 4.0, 5.0
TIME_STEP_S = 0.002
MARGIN_M = 0.02
TABLE_SIZE, TABLE_AT = (0.5, 0.8, 0.08), (-0.05, 0.0, 0.04)
HOME = np.radians((0.0, 30.0, 0.0, -90.0, 0.0, 60.0, 0.0))
AT_TABLE = HOME + np.radians((0.0, 25.0, 0.0, 0.0, 0.0, 0.0, 0.0))
SIZE_PX = (400, 380)


class Motion(NamedTuple):
    """A motion that ends in a collision.

    Attributes:
        title: Title of its pictures.
        other: Name of the body that the arm meets.
        goal: Joint positions in which the arm collides [rad].
        check: The guard's check that prevents the collision.
        camera: Camera that sees the place of the collision.
    """

    title: str
    other: str
    goal: Array
    check: type
    camera: Photographer


def draw_guard(path: Path) -> None:
    """Draws both motions without and with the guard, and the distances of the arm over time."""
    figure, axes = new_figure(2, 3, (10.6, 6.4), width_ratios=(1.0, 1.0, 1.05))
    with tempfile.TemporaryDirectory(prefix="rpbi-") as folder:
        main, robot = _write_world(Path(folder)), RobotModel(LWR)
        judge = _new_guard(robot, main)
        for row, motion in enumerate(_motions(judge)):
            for column, guard in enumerate((None, _new_guard(robot, main))):
                word, colour = ("with guard", GOOD) if guard else ("without guard", BAD)
                world = World.from_file(main, connection_mode=pybullet.DIRECT)
                q = _drive(world, guard, motion.goal, robot.joint_names)
                image = axes[3 * row + column]
                show(image, motion.camera.picture(world))
                image.set_title(f"{motion.title}, {word}", color=colour)
                world.close()
                _draw_distance(axes[3 * row + 2], _distances_mm(judge, q, motion), word, colour)
            _finish(axes[3 * row + 2], motion)
    save(figure, path, has_photographs=True)


def _draw_distance(axes: Axes, distance_mm: Array, word: str, colour: str) -> None:
    time_s = PERIOD_S * np.arange(len(distance_mm))
    axes.plot(time_s, distance_mm, color=colour, lw=2.2)
    end_mm = distance_mm[-1]
    axes.annotate(
        f"{end_mm:.0f} mm", (time_s[-1], end_mm), (4, 0), color=colour, fontsize=12, textcoords="offset points",
        va="center", annotation_clip=False,
    )  # fmt: skip
    print(f"{word}: nearest {distance_mm.min():.2f} mm, at last {end_mm:.2f} mm")


def _finish(axes: Axes, motion: Motion) -> None:
    margin_mm = 1e3 * MARGIN_M
    axes.axhline(margin_mm, color="black", linestyle=":")
    axes.text(1.5, margin_mm + 4.0, f"margin: {margin_mm:.0f} mm", fontsize=10)
    axes.axhspan(-40.0, 0.0, color=BAD, alpha=0.1, lw=0)
    axes.text(0.1, -35.0, "collision", color=BAD, fontsize=10)
    axes.set(xlabel="time [s]", ylabel="distance [mm]", xlim=(0.0, SHOWN_S), ylim=(-40.0, 120.0))
    axes.set_title(f"distance from {motion.other}")


def _write_world(folder: Path) -> str:
    """Writes an arm and a table, and returns the main file."""
    half = [size / 2.0 for size in TABLE_SIZE]
    table = {
        "name": "table",
        "createVisualShape": {"shapeType": "GEOM_BOX", "halfExtents": half, "rgbaColor": [0.7, 0.5, 0.3, 1.0]},
        "createCollisionShape": {"shapeType": "GEOM_BOX", "halfExtents": half},
        "basePosition": list(TABLE_AT),
    }
    (folder / "table.yaml").write_text(yaml.safe_dump(table))
    main = {
        "setGravity": {"gravZ": -9.81},
        "timeStep": TIME_STEP_S,
        "collision_objects": [str(folder / "table.yaml")],
        "robots": ["{rpbi_examples}/configs/basic_example_kuka_lwr/kuka_lwr.yaml"],
    }
    (folder / "world.yaml").write_text(yaml.safe_dump(main))
    return str(folder / "world.yaml")


def _new_guard(robot: RobotModel, world: str) -> Guard:
    """Returns a guard that knows the table, halts at the first unsafe target, and brakes then."""
    options = {
        "period_s": PERIOD_S,
        "start_from": "target",
        "on_halt": "brake",
        "limits": {"acceleration": 10.0, "jerk": 1000.0},
        "checks": {"environment": {"world": world, "margin_m": MARGIN_M}, "self_collision": {"margin_m": MARGIN_M}},
    }
    guard = Guard(GuardConfig.parse(options, "picture"), robot, "picture")
    guard.start()
    return guard


def _motions(judge: Guard) -> tuple[Motion, Motion]:
    at_table = Photographer((-0.2, -0.9, 0.16), (0.03, 0.0, 0.15), 22.0, SIZE_PX)
    at_base = Photographer((0.0, -0.62, 0.38), (0.46, -0.05, 0.06), 30.0, SIZE_PX)
    return (
        Motion("at the table", "the table", AT_TABLE, Environment, at_table),
        Motion("into itself", "itself", _folded(judge), SelfCollision, at_base),
    )


def _contacts_m(guard: Guard, q: Array, kind: type) -> dict[Pair, float]:
    """Returns the distances of the pairs of a check [m]; negative if they penetrate."""
    (check,) = (each for each in guard.checks if isinstance(each, kind))
    found: Any = check
    return {pair: contact.distance for pair, contact in found.proximity.contacts(q, 2.0)}


def _distances_mm(guard: Guard, positions: Array, motion: Motion) -> Array:
    """Returns the smallest distance of the pairs that collide at the goal, for each row of joint positions [mm].

    Other pairs, such as neighbouring links, may always be near.
    """
    at_goal = _contacts_m(guard, motion.goal, motion.check)
    met = [pair for pair, distance in at_goal.items() if distance < 0.0]
    found = (_contacts_m(guard, q, motion.check) for q in positions)
    return np.array([1e3 * min(each[pair] for pair in met) for each in found])


def _folded(guard: Guard) -> Array:
    """Returns a configuration within limits in which the arm penetrates itself, far from the table."""
    choose = random.Random(0)
    low, high = guard.limits.lower, guard.limits.upper

    def nearest(q: Array, kind: type) -> float:
        return min(_contacts_m(guard, q, kind).values())

    while True:
        q = np.array([choose.uniform(a, b) for a, b in zip(low, high)])
        if nearest(q, SelfCollision) < -0.02 and nearest(q, Environment) > 0.1:
            between = [HOME + s * (q - HOME) for s in np.linspace(0.0, 1.0, 30)]
            if min(nearest(each, Environment) for each in between) > 0.05:
                return q


def _drive(world: World, guard: Guard | None, goal: Array, names: tuple[str, ...]) -> Array:
    """Moves the arm smoothly towards a configuration, as far as the guard permits.

    Returns the positions of the arm's joints after each period, shape (periods, joints) [rad].
    """
    command, found = HOME, []
    for k in range(round(SHOWN_S / PERIOD_S)):
        t = min(k * PERIOD_S / DURATION_S, 1.0)
        target = HOME + t**3 * (10.0 - 15.0 * t + 6.0 * t**2) * (goal - HOME)
        command = target if guard is None else _guarded(guard, target, command)
        world.put("kuka_lwr/target", dict(zip(names, command.tolist())))
        for _ in range(round(PERIOD_S / TIME_STEP_S)):
            world.step()
        arm: Any = world.bodies["kuka_lwr"]
        found.append(list(arm.joint_positions().values()))
    return np.array(found)


def _guarded(guard: Guard, target: Array, command: Array) -> Array:
    """Returns the next command: the target if it is safe, then the braking, then the last command."""
    decision = guard.decide(tuple(target.tolist()), CheckContext())
    if decision.violation is not None:
        print(decision.violation)
    safe = decision.command or guard.next_braking()
    return command if safe is None else np.array(safe)
