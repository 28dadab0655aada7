"""The picture of the solver `tasks`: Talos reaches for three targets, and its centre of mass stays over its feet."""

from __future__ import annotations

from pathlib import Path
from typing import cast

from plots import GOOD, empty_figure, save, show
from render import Photographer

from custom_ros_tools.config import load_config
from custom_ros_tools.plot_style import legend_below
from ik_ros.lookup import make_solver
from ik_ros.problem import IKProblem
from ik_ros.solvers.tasks import TasksSolver
from ik_ros.tasks.com_in_support import ComInSupport
from ik_ros.tasks.robot import to_se3
from robot_model.geometry import Pose, Vector
from rpbi.world import World

IK = "{rpbi_examples}/configs/ik_talos/ik.yaml"
WORLD = "{rpbi_examples}/configs/basic_example_talos/config.yaml"
TARGETS: tuple[Vector, ...] = ((0.5, 0.2, 1.0), (0.9, 0.2, 1.0), (0.5, 0.3, 0.4))
"""Targets of the left hand, in the frame between the feet [m]."""
CAMERA, MIDDLE, FOV_DEG, SIZE_PX = (2.2, 1.9, 1.35), (0.2, 0.05, 0.8), 34.0, (460, 480)
TARGET_COLOUR = "#d62728"


def draw_ik_talos(path: Path) -> None:
    """Draws the posture for each target above the support polygon and the centre of mass."""
    solver = cast(TasksSolver, make_solver("tasks", load_config(IK)))
    balance = cast(ComInSupport, solver.tasks.parts["balance"].task)
    robot = solver.tasks.robot
    world, camera = World.from_file(WORLD), Photographer(CAMERA, MIDDLE, FOV_DEG, SIZE_PX)
    figure = empty_figure((11.0, 6.6))
    scenes, supports = figure.subplots(2, len(TARGETS), height_ratios=(2.6, 1.0))
    for target, scene, support in zip(TARGETS, scenes, supports):
        solution = solver.solve(IKProblem(target=Pose(target)))
        assert solution.base_pose is not None
        world.act("talos", "teleport", solution.base_pose)
        joints = dict(zip(solver.joint_names, solution.positions))
        world.act("talos", "set_joint_state", joints)
        show(scene, camera.picture(world))
        scene.plot(*camera.pixel(target), "o", mfc="none", mec=TARGET_COLOUR, ms=18, mew=2)
        scene.set_title("target {:.1f}, {:.1f}, {:.1f} m".format(*target))
        q = robot.with_base(robot.configuration(joints), to_se3(solution.base_pose))
        robot.update(q)
        centre, _ = robot.com(q)
        corners = balance.polygon()
        support.fill(corners[:, 1], corners[:, 0], color="#cfe3ef", label="support polygon")
        support.plot(centre[1], centre[0], "o", color=GOOD, label="centre of mass")
        support.set(xlabel="y, to the left [m]", xlim=(0.2, -0.2), ylim=(-0.15, 0.15), aspect="equal")
    supports[0].set_ylabel("x, forward [m]")
    legend_below(figure, supports[0], 2)
    world.close()
    save(figure, path, has_photographs=True)
