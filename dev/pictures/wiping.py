"""Picture of docs/controllers.md: an arm wipes a table with a constant force, tick by tick."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from overlay import Overlay
from plots import empty_figure, save, show
from render import Photographer

from custom_ros_tools.plot_style import BLUE, ORANGE
from robot_model.geometry import Pose, Vector
from rpbi.samples import ContactsSample
from rpbi.world import World
from rpbi_examples.motions import wiped
from rpbi_examples.pushing import ball_solver
from rpbi_examples.ros.moving_robots import HZ, SETTLING_S

TABLE_AT = (-0.04, 0.0, 0.03)
"""Place of the table by `poses` of the world [m]."""
FORCE_N, SHOWN_S = 20.0, 9.0
METRES_A_NEWTON = 0.012
"""Length of the arrow for each newton [m]."""
CAMERA = Photographer((-0.85, -0.85, 0.55), (0.03, 0.0, 0.19), 31.0, (600, 540))


class Touch(NamedTuple):
    """Contact of the arm with the table: time [s], normal force [N], and the point in the world [m]."""

    time_s: float
    force_n: float
    point: Vector | None


def draw_wiping(path: Path) -> None:
    """Draws the arm with the force of the table on it, and the force over time."""
    world = World.from_file("{rpbi_examples}/configs/wiping_example/config.yaml")
    touches = _wiped(world)
    view = Overlay(CAMERA, CAMERA.picture(world))
    world.close()
    points = [each.point for each in touches if each.point is not None]
    view.line(points, BLUE, 3.0)
    x, y, z = points[-1]
    view.arrow((x, y, z), (x, y, z + METRES_A_NEWTON * touches[-1].force_n), ORANGE, 7.0)
    view.words((x, y, z + METRES_A_NEWTON * touches[-1].force_n), f"{touches[-1].force_n:.1f} N", ORANGE, (14, 4))
    view.words(points[len(points) // 2], "path of the tip", BLUE, (16, 18))
    figure = empty_figure((10.6, 4.8))
    left, right = figure.subplots(1, 2, width_ratios=(1.05, 1.0))
    show(left, view.picture())
    _draw_force(right, touches)
    save(figure, path, has_photographs=True)


def _draw_force(axes: Any, touches: Sequence[Touch]) -> None:
    touched_s = next(each.time_s for each in touches if each.force_n > 0.0)
    axes.plot([each.time_s for each in touches], [each.force_n for each in touches], color=ORANGE)
    axes.axhline(FORCE_N, color="0.3", lw=1.0, ls="--")
    axes.text(SHOWN_S - 0.1, FORCE_N + 1.0, f"configured: {FORCE_N:g} N", color="0.3", ha="right")
    for begin_s, end_s, word in ((0.0, touched_s, "moves\ndown"), (touched_s + SETTLING_S, SHOWN_S, "wipes")):
        axes.axvline(begin_s, color="0.6", lw=1.0, ls=":")
        axes.text((begin_s + end_s) / 2.0, 9.0, word, ha="center", color="0.3")
    axes.set(xlabel="time [s]", ylabel="force of the table on the tip [N]", xlim=(0.0, SHOWN_S), ylim=(0.0, 26.0))


def _wiped(world: World) -> list[Touch]:
    """Runs the example, and returns the contacts of the arm with the table."""
    solver = ball_solver()
    arm: Any = world.bodies["kuka_lwr"]
    world.put("table/pose", Pose(TABLE_AT))
    found: list[Touch] = []
    start: Pose | None = None
    start_s = 0.0
    ticks = round(1.0 / (HZ * world.config.timeStep))
    for number in range(round(SHOWN_S * HZ)):
        time_s = number / HZ
        touched_s = next((each.time_s for each in found if each.force_n > 0.0), time_s)
        if time_s > touched_s + SETTLING_S:
            if start is None:
                start, start_s = arm.base_pose() @ solver.chain.pose(list(arm.joint_positions().values())), time_s
            x, y, z = start.position
            world.put("kuka_lwr/wipe/target", Pose((x, y + wiped(time_s - start_s), z), start.quat_xyzw))
        for _ in range(ticks):
            samples = [each for each in world.step() if isinstance(each, ContactsSample) and each.name == "kuka_lwr"]
            found += [_touch(world.clock.tick * world.config.timeStep, each) for each in samples]
    return found


def _touch(time_s: float, sample: ContactsSample) -> Touch:
    points = [point for point in sample.points if point.other_body == "table"]
    return Touch(time_s, sum(point.normal_force for point in points), points[0].position if points else None)
