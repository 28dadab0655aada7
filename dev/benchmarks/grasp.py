"""Drift of a box in a gripper's coupled fingers, and accuracy of its placement; runs without ROS, as fast as
possible.
"""

from __future__ import annotations

import math
import random

from bench_worlds import CONFIGS
from result import Result, Target

from rpbi.control.joint_command import JointCommand
from rpbi.geometry import Pose
from rpbi.kinematics import IKProblem
from rpbi.world import World
from rpbi.world.actions import TimedGoal
from rpbi_examples.motions import CARRY_HEIGHT, FINGERS_CLOSED, GraspStep, PlanarPose, pick_and_place

HOLD_S, QUICK_HOLD_S = 60.0, 5.0
SEEDS, QUICK_SEEDS = 20, 2
DRIFT_MM_S = 0.05
PLACED_MM = 2.0
MOVE_S, FINGERS_S = 2.0, 1.0
"""Time that a step takes [s]."""


class Grasp:
    """The world of the example, driven by the actions of its services and topics."""

    def __init__(self, box: PlanarPose) -> None:
        self.world = World.from_file(str(CONFIGS / "grasp_example" / "config.yaml"))
        quat = (0.0, 0.0, math.sin(box.yaw / 2.0), math.cos(box.yaw / 2.0))
        self.world.act("box", "teleport", Pose((box.x, box.y, 0.025), quat))
        self.wait(0.2)

    def wait(self, seconds: float) -> None:
        """Lets time pass."""
        for _ in range(round(seconds / self.world.clock.dt_s)):
            self.world.step()

    def box(self) -> PlanarPose:
        """Returns where the box is."""
        (x, y, _), quat = self.world.bodies["box"].base_pose()
        return PlanarPose(x, y, 2.0 * math.atan2(quat[2], quat[3]))

    def observe(self, step: GraspStep) -> None:
        """Simulates a step: the hand moves to its target, then the fingers."""
        robot = self.world.bodies["panda"]
        positions = tuple(robot.joint_positions().values())
        problem = IKProblem(
            "panda_grasptarget",
            step.position,
            step.quat_xyzw,
            currentPosition=positions,
            residualThreshold=1e-5,
        )
        solution = robot.kinematics.solve(problem)
        if not solution.success:
            raise RuntimeError(solution.message)
        goal = robot.model.resolve(solution.chain, solution.chain_positions)
        motion = self.world.act("panda", "move", TimedGoal(goal, MOVE_S))
        while not motion.is_over:
            self.world.step()
        if not motion.result.result().success:
            raise RuntimeError(motion.result.result().message)
        self.world.put("panda/target", JointCommand(["panda_finger_joint1"], [step.finger]))
        self.wait(FINGERS_S)


def drift_mm_s(hold_s: float) -> tuple[float, float]:
    """Returns the speed of a lifted box in the world, as mean and in its worst second [mm/s]."""
    grasp = Grasp(PlanarPose(0.5, -0.2, 0.35))
    for step in pick_and_place(grasp.box(), PlanarPose(0.5, 0.2, 0.0)):
        grasp.observe(step)
        if step.height == CARRY_HEIGHT and step.finger == FINGERS_CLOSED:
            break
    places = []
    for _ in range(round(hold_s) + 1):
        places.append(grasp.world.bodies["box"].base_pose().position)
        grasp.wait(1.0)
    grasp.world.close()
    worst = max(map(math.dist, places, places[1:]))
    return math.dist(places[0], places[-1]) / hold_s * 1e3, worst * 1e3


def placed_mm(seed: int) -> float:
    """Returns the distance from the goal at which a box from a random place is put down [mm]."""
    draw = random.Random(seed)
    grasp = Grasp(PlanarPose(draw.uniform(0.4, 0.6), draw.uniform(-0.3, -0.1), draw.uniform(-math.pi, math.pi)))
    goal = PlanarPose(draw.uniform(0.4, 0.6), draw.uniform(0.1, 0.3), draw.uniform(-0.7, 0.7))
    for step in pick_and_place(grasp.box(), goal):
        grasp.observe(step)
    placed = grasp.world.bodies["box"].base_pose().position
    grasp.world.close()
    return math.dist(placed, (goal.x, goal.y, 0.025)) * 1e3


def run(quick: bool) -> list[Result]:
    """Holds a box for a while, and carries boxes from and to places by seed."""
    hold_s, seeds = (QUICK_HOLD_S, QUICK_SEEDS) if quick else (HOLD_S, SEEDS)
    drift, worst = drift_mm_s(hold_s)
    off = [placed_mm(seed) for seed in range(seeds)]
    return [
        Result("grasp", f"drift of a held box in {hold_s:g} s", drift, "mm/s", None, Target(DRIFT_MM_S)),
        Result("grasp", f"drift in the worst second of {hold_s:g}", worst, "mm/s", None, Target(DRIFT_MM_S)),
        Result(
            "grasp",
            f"boxes placed within {PLACED_MM:g} mm, of {seeds} trials",
            sum(each <= PLACED_MM for each in off),
            "",
            None,
            Target(seeds, at_least=True),
        ),
        Result("grasp", f"farthest from its goal, of {seeds}", max(off), "mm", None, Target(PLACED_MM)),
    ]
