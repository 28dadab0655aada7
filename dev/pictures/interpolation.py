"""Picture of docs/interpolation.md: the tip of an arm on its path through three balls, and the motion over time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml
from overlay import Overlay
from plots import empty_figure, save, show
from render import Photographer

from ik_ros.problem import IKProblem
from ik_ros.solvers.kdl import KdlConfig, KdlSolver
from robot_model.geometry import Pose
from rpbi.world import World
from rpbi_examples.ros.run_interpolation import VISITS
from rpbi_examples.waypoint_plot import draw_motion
from rpbi_utils.interpolation.config import WaypointMotionConfig
from rpbi_utils.interpolation.interpolator import Interpolator
from rpbi_utils.interpolation.waypoints import read_waypoints

Array = npt.NDArray[np.float64]

CONFIGS = Path(__file__).resolve().parents[2] / "src/rpbi_examples/configs"
MOTION, SOLVER = CONFIGS / "interpolation/traj_lwr.yaml", CONFIGS / "kuka_lwr_ik_example/kdl.yaml"
PERIOD_S, AFTER_S = 0.01, 1.0
"""Time between two targets, and time for which the motion is watched after the last ball [s]."""
CAMERA = Photographer((-1.0, 1.25, 0.70), (-0.27, 0.10, 0.37), 37.0, (600, 600))
OFFSETS_PX = {"green": (-112.0, 4.0), "blue": (20.0, -20.0), "red": (24.0, 14.0)}
COLOURS = {"green": "#17804a", "blue": "#2659d9", "red": "#d92e20"}


def draw_interpolation(path: Path) -> None:
    """Draws the arm at the end of its path, and position and speed of plan and tip over time."""
    world = World.from_file("{rpbi_examples}/configs/interpolation/config.yaml")
    rows, times_s, waypoints = _moved(world)
    view = Overlay(CAMERA, CAMERA.picture(world))
    view.line([tuple(row[2]) for row in rows], "#e67814", 4.0)
    view.dot(tuple(waypoints[:, 0]), "#22333f")
    view.words(tuple(waypoints[:, 0]), "start, 0 s", offset_px=(-30, 26))
    for visit in VISITS:
        words, colour = f"{visit.colour}, {visit.time_s:g} s", COLOURS[visit.colour]
        view.words(visit.position, words, colour, OFFSETS_PX[visit.colour])
    world.close()
    figure = empty_figure((10.6, 5.2))
    left, right = figure.subfigures(1, 2, width_ratios=(1.0, 1.2))
    show(left.subplots(), view.picture())
    draw_motion(right, rows, times_s, waypoints)
    save(figure, path, has_photographs=True)


def _moved(world: World) -> tuple[list[tuple[float, Array, Array]], list[float], Array]:
    """Moves the tip as the launch file does, tick by tick.

    Returns:
        Times with the positions of plan and tip, times of the waypoints [s], and their positions, shape (3, n) [m].
    """
    config = WaypointMotionConfig.parse(yaml.safe_load(MOTION.read_text()), str(MOTION))
    solver = KdlSolver(KdlConfig.parse(yaml.safe_load(SOLVER.read_text()), str(SOLVER)))
    for visit in VISITS:
        world.put(f"{visit.colour}/pose", {"position": visit.position, "quat_xyzw": (0.0, 0.0, 0.0, 1.0)})
    joints = _joints(world)
    start = solver.chain.pose(joints)
    times_s = [0.0, *(visit.time_s for visit in VISITS)]
    positions = np.array([start.position, *(visit.position for visit in VISITS)]).T
    quats = np.tile(np.reshape(start.quat_xyzw, (4, 1)), len(times_s))
    interpolator = Interpolator(config)
    waypoints = read_waypoints(np.vstack([times_s, positions, quats]), config.motion_dimensions)
    interpolator.add(waypoints, 0.0)
    rows, target = [], start
    for number in range(round((times_s[-1] + AFTER_S) / PERIOD_S)):
        sample = interpolator.newest(number * PERIOD_S)
        target = target if sample is None or sample.pose is None else sample.pose
        solution = solver.solve(IKProblem(target, start=dict(zip(solver.joint_names, joints))))
        joints = list(solution.positions)
        world.put("kuka_lwr/target", dict(zip(solver.joint_names, joints)))
        for _ in range(round(PERIOD_S / world.config.timeStep)):
            world.step()
        tip: Pose = solver.chain.pose(_joints(world))
        rows.append((number * PERIOD_S, np.array(target.position), np.array(tip.position)))
    return rows, times_s, positions


def _joints(world: World) -> list[float]:
    arm: Any = world.bodies["kuka_lwr"]
    return list(arm.joint_positions().values())
