"""Plans pass through the guard's checks before they are offered."""

from __future__ import annotations

from typing import NamedTuple

from safe_robot.check import CheckContext
from safe_robot.config import GuardConfig
from safe_robot.guard import Guard

from .group import Group
from .scene import PlanningScene
from .scene_robot import SceneRobot
from .timing import PathTiming, PlannedTrajectory

PERIOD_S = 0.01
"""Time between two commands that are checked [s]."""
MARGIN_M = 1e-3
"""Margin of the guard's distances to bodies [m], for braking that begins between two commands that are checked."""
SHAPES_M = 2e-3
"""Largest difference between distances by PyBullet, whose shapes have rounded edges, and by hpp-fcl [m]."""
SLOWER = 1.5
"""Factor of the duration when the guard refuses a motion because braking would leave the path."""
SLOWEST = 12.0
"""Largest factor of the duration."""


def guard_of(scene: PlanningScene, robot: SceneRobot, margin_m: float = 0.0, period_s: float = PERIOD_S) -> Guard:
    """Returns a guard with the scene's limits and, as margins, a small distance, since the padding is larger.

    The guard checks the limits of the joints, links against each other, and links against bodies, for each command and
    for the braking after it.

    Args:
        scene: The scene.
        robot: The robot.
        margin_m: Least distance from bodies [m].
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
        "checks": {"self_collision": {"margin_m": 0.0}, "environment": {"margin_m": margin_m}},
    }
    return Guard(GuardConfig.parse(options, robot.model.urdf_path), robot.model, robot.model.urdf_path)


class Refusal(NamedTuple):
    """A command that the guard refuses.

    Attributes:
        time_s: Time of the command in the motion [s].
        is_while_braking: True if the braking after the command is refused, False if the command itself is.
        words: Description.
    """

    time_s: float
    is_while_braking: bool
    words: str


def refusal(
    scene: PlanningScene, group: Group, trajectory: PlannedTrajectory, r: int, margin_m: float = 0.0
) -> Refusal | None:
    """Returns the first command of a motion that the guard of one robot of a group refuses; None if there is none."""
    robot = group.robots[r]
    key = margin_m, *(each.tobytes() for each in robot.limits)
    if robot.guard is None or robot.guard[0] != key:
        robot.guard = key, guard_of(scene, robot, margin_m)
    guard = robot.guard[1]
    obstacles = tuple(each for each in scene.obstacles_for(robot.name) if not _may_touch(scene, robot.name, each.name))
    context = CheckContext(obstacles=obstacles)
    guard.rest()
    guard.start()
    for i, q in enumerate(group.full(trajectory.sampled(PERIOD_S), r).tolist()):
        measured = {} if i else dict(zip(robot.model.joint_names, q))  # a guard that has been used starts anew
        violation = guard.decide(tuple(q), context._replace(measured=measured)).violation
        if violation is not None:
            time_s = min(i * PERIOD_S, trajectory.duration_s)
            return Refusal(time_s, violation.is_while_braking, f"{time_s:.2f} s: {violation}")
    return None


def _may_touch(scene: PlanningScene, robot: str, body: str) -> bool:
    """Returns whether some link of a robot is allowed to touch a body; then the guard is not asked about the body."""
    return any(body in pair and any(name.split("/")[0] == robot for name in pair) for pair in scene.allowed)


def certified(
    scene: PlanningScene, group: Group, timing: PathTiming, padding_m: float
) -> tuple[PlannedTrajectory, str]:
    """Passes a motion, whose distance from bodies is at least `padding_m`, through the guard's checks.

    Where braking would leave the path and touch something, the motion stops at the nearest corner. If there is no
    corner left, the whole motion becomes slower.

    Returns:
        The motion, and the reason for which the guard refuses it; empty if the guard accepts it.
    """
    trajectory, factor = timing.trajectory, 1.0
    margin_m = MARGIN_M if padding_m > MARGIN_M + SHAPES_M else 0.0
    while True:
        found = (refusal(scene, group, trajectory, r, margin_m) for r in range(len(group.robots)))
        refused = next((each for each in found if each is not None), None)
        if refused is None or not refused.is_while_braking:
            return trajectory, "" if refused is None else refused.words
        if factor == 1.0 and timing.stop_near(refused.time_s):
            trajectory = timing.trajectory
            continue
        factor *= SLOWER
        if factor > SLOWEST:
            return trajectory, refused.words
        trajectory = timing.trajectory.slower(factor)
