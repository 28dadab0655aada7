"""The telepresence example without ROS: a person of chance holds out an arm and is dressed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from operator_node.avatar.anthropometry import segment_offsets
from operator_node.avatar.engagement import Engagement
from operator_node.avatar.forward import segment_frame
from operator_node.avatar.joints import HINGES
from operator_node.avatar.retargeting import AvatarPose, Retargeting
from operator_node.mvn.segments import SegmentFrame
from rpbi.geometry import Pose, Vector
from rpbi.samples import ContactsSample, SurfaceSample
from rpbi.world import World

from .dressing import ARM_SEGMENTS, ArmPosition, Dressing, HandSolver, MeanForce, Outcome, outcome

WORLD = "{rpbi_examples}/configs/telepresence/config.yaml"
AVATAR_HEIGHT_M = 1.75
HEIGHTS_M = (1.60, 1.90)
SWAY_RAD, SWAY_HZ = 0.02, 0.4
"""Nobody holds an arm quite still."""
HELD_OUT_S = 3.0
"""Time in which the person raises the arm [s]."""
TARGET_HZ = 50
LONGEST_S = 30.0


class Person:
    """A person who raises an arm and holds it out; how tall they are and how they hold it is random.

    Args:
        seed: Of what is random.
    """

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        self._height_m = random.uniform(*HEIGHTS_M)
        self._offsets = segment_offsets(self._height_m)
        self._held = np.radians((random.uniform(-8, 8), random.uniform(74, 86), random.uniform(5, 25)))
        self._phase = random.uniform(0.0, 2.0 * math.pi)

    def frame(self, time_s: float) -> SegmentFrame:
        """Returns the segments at a time [s]."""
        raised = min(time_s / HELD_OUT_S, 1.0)
        raised = raised * raised * (3.0 - 2.0 * raised)
        up, ahead, elbow = self._held
        sway = SWAY_RAD * math.sin(2.0 * math.pi * SWAY_HZ * time_s + self._phase)
        hinges = {
            "jLeftShoulder_rotx": -1.3,
            "jRightShoulder_rotx": (1.0 - raised) * 1.3 + raised * up + sway,
            "jRightShoulder_rotz": raised * ahead + sway,
            "jRightElbow_rotz": raised * elbow,
        }
        hips = np.array((0.0, 0.0, 0.53 * self._height_m))
        return segment_frame(self._offsets, hips, np.array((0.0, 0.0, 0.0, 1.0)), hinges)


def run_trial(seed: int, force_limit_n: float = 15.0, speed: float = 0.1) -> Outcome:
    """Runs the example as fast as it goes and returns what became of it.

    Args:
        seed: Of the person.
        force_limit_n: Force on the arm above which the cuff goes back [N].
        speed: Of the cuff [m/s].
    """
    world = World.from_file(WORLD)
    try:
        return _run(world, Person(seed), Dressing(force_limit_n, speed))
    finally:
        world.close()


def _run(world: World, person: Person, dressing: Dressing) -> Outcome:
    human: Any = world.bodies["human"]
    robot: Any = world.bodies["panda"]
    retargeting = Retargeting(segment_offsets(AVATAR_HEIGHT_M))
    engagement = Engagement(max_joint_speed=3.0, max_speed=1.0, max_angular_speed=3.0)
    links = {human.link_name(index): index for index in range(-1, len(human.joint_indices))}
    positions = dict(zip((joint.name for joint in human.model.moving), human.joint_positions().values()))
    base = human.base_pose()
    first = np.array([positions[hinge] for hinge in HINGES])
    engagement.begin(AvatarPose(np.array(base.position), np.array(base.quat_xyzw), first))
    solver = HandSolver(robot.kinematics)
    forces = MeanForce()
    corners: tuple[Vector, ...] = ()
    ticks = round(1.0 / (TARGET_HZ * world.clock.dt_s))
    for number in range(round(LONGEST_S * TARGET_HZ)):
        time_s, dt = number / TARGET_HZ, 1.0 / TARGET_HZ
        pose = engagement.step(retargeting.pose(person.frame(time_s)), dt)
        world.put("human/pose", Pose(tuple(pose.position.tolist()), tuple(pose.quat_xyzw.tolist())))
        world.put("human/target", dict(zip(HINGES, pose.hinges.tolist())))
        joints = ("RightUpperArm", "RightForeArm", "RightHand")
        arm = ArmPosition(*(np.array(human.link_pose(links[name]).position) for name in joints))
        world.put("elbow/pose", Pose(tuple(arm.elbow.tolist())))
        force_n = 0.0
        for _ in range(ticks):
            for sample in world.step():
                if isinstance(sample, ContactsSample) and sample.name == "human":
                    force_n = forces.add(world.clock.time_s, force_on_arm(sample))
                elif isinstance(sample, SurfaceSample):
                    corners = sample.corners
        if time_s >= HELD_OUT_S:
            target = dressing.target(arm, force_n, dt)
            if (found := solver.solve(target, tuple(robot.joint_positions().values()))) is not None:
                world.put("panda/target", found)
        if dressing.is_done:
            break
    return outcome(corners, arm, forces.peak_n)


def force_on_arm(sample: ContactsSample) -> np.ndarray:
    """Returns the sum of forces on the arm [N]."""
    return np.sum([(0.0, 0.0, 0.0), *(p.force for p in sample.points if p.link in ARM_SEGMENTS)], axis=0)
