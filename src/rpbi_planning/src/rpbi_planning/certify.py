"""Plans pass through the guard's checks before they are offered."""

from __future__ import annotations

import numpy as np

from robot_model.collision.shapes import Obstacle
from safe_robot.check import CheckContext
from safe_robot.config import GuardConfig
from safe_robot.guard import Guard

from .collision import CollisionModel, Group
from .scene import PlanningScene, SceneRobot
from .timing import Trajectory

Array = np.ndarray
PERIOD_S = 0.02
"""Time between two commands that are checked [s]."""
SLOWER = 1.3
"""Factor of the duration when the guard refuses a motion because braking would leave the path."""
TRIES = 6


def guard_of(scene: PlanningScene, robot: SceneRobot, margin_m: float = 0.0, period_s: float = PERIOD_S) -> Guard:
    """Returns a guard with the scene's limits and, as margins, a small distance, since the padding is larger.

    The guard checks the limits of the joints, links against each other, and links against bodies, for each command and
    for the braking after it.

    Args:
        scene: The scene.
        robot: The robot.
        margin_m: Least distance [m].
        period_s: Time between two commands [s].
    """
    limits = robot.limits
    by_joint = dict(zip(robot.model.joint_names, range(len(limits.velocity))))
    options = {
        "period_s": period_s,
        "start_from": "target",
        "limits": {
            "velocity_factor": 1.0,
            "velocity": {name: float(limits.velocity[i]) * (1.0 + 1e-6) for name, i in by_joint.items()},
            "acceleration": {name: float(limits.acceleration[i]) * (1.0 + 1e-6) for name, i in by_joint.items()},
            "jerk": {name: float(limits.jerk[i]) * (1.0 + 1e-3) for name, i in by_joint.items()},
        },
        "checks": {"self_collision": {"margin_m": margin_m}, "environment": {"margin_m": margin_m}},
    }
    return Guard(GuardConfig.parse(options, robot.model.urdf_path), robot.model, robot.model.urdf_path)


def refusal(scene: PlanningScene, group: Group, trajectory: Trajectory, r: int) -> str:
    """Returns the reason for which the guard refuses a motion of one robot of a group; empty if it accepts it."""
    robot = group.robots[r]
    guard = guard_of(scene, robot)
    obstacles: tuple[Obstacle, ...] = tuple(
        obstacle for obstacle in scene.obstacles_for(robot.name)
        if not _may_touch(scene, robot.name, obstacle.name)
    )  # fmt: skip
    context = CheckContext(obstacles=obstacles)
    guard.start()
    for i, q in enumerate(group.full(trajectory.sampled(PERIOD_S), r)):
        decision = guard.decide(tuple(q.tolist()), context)
        if decision.violation is not None:
            return f"{i * PERIOD_S:.2f} s: {decision.violation}"
    return ""


def _may_touch(scene: PlanningScene, robot: str, body: str) -> bool:
    """Returns whether some link of a robot is allowed to touch a body; then the guard is not asked about the body."""
    return any(body in pair and any(name.split("/")[0] == robot for name in pair) for pair in scene.allowed)


def certified(
    scene: PlanningScene, group: Group, trajectory: Trajectory, model: CollisionModel
) -> tuple[Trajectory, str]:
    """Passes a motion through the guard's checks; slows it down where the guard could not brake in time.

    Returns:
        The motion, maybe slower, and the reason for which the guard refuses it; empty if the guard accepts it.
    """
    reason = ""
    for _ in range(TRIES):
        reason = next(filter(None, (refusal(scene, group, trajectory, r) for r in range(len(group.robots)))), "")
        if "while braking" not in reason:
            break
        trajectory = trajectory.slower(SLOWER)
    return trajectory, reason
