"""The telepresence example without ROS: a person of chance holds out an arm and is dressed."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from operator_node.avatar.anthropometry import segment_offsets
from operator_node.avatar.engagement import Engagement
from operator_node.avatar.joints import HINGES
from operator_node.avatar.retargeting import AvatarPose, Retargeting
from operator_node.emulators.arm_held_out import RAISING_S, ArmHeldOut
from rpbi.geometry import Pose, Vector
from rpbi.samples import ContactsSample, SurfaceSample
from rpbi.world import World

from .dressing import ARM_SEGMENTS, TARGET_HZ, ArmPosition, Dressing, HandSolver, MeanForce, Outcome, outcome

WORLD = "{rpbi_examples}/configs/telepresence/config.yaml"
AVATAR_HEIGHT_M = 1.75
HEIGHTS_M = (1.60, 1.90)
"""Of the people."""
FORCE_LIMIT_N, SPEED = 15.0, 0.1
LONGEST_S = 30.0


def run_trial(seed: int, force_limit_n: float = FORCE_LIMIT_N, speed: float = SPEED) -> Outcome:
    """Runs the example as fast as it goes and returns what became of it.

    Args:
        seed: Of the person: how tall they are, and how they hold the arm.
        force_limit_n: Force on the arm above which the cuff goes back [N].
        speed: Of the cuff [m/s].
    """
    world = World.from_file(WORLD)
    try:
        height_m = np.random.default_rng((seed, 1)).uniform(*HEIGHTS_M)
        return _run(world, ArmHeldOut(height_m, seed), Dressing(force_limit_n, speed))
    finally:
        world.close()


def _run(world: World, person: ArmHeldOut, dressing: Dressing) -> Outcome:
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
        if time_s >= RAISING_S:
            target = dressing.target(arm, force_n, dt)
            if (found := solver.solve(target, tuple(robot.joint_positions().values()))) is not None:
                world.put("panda/target", found)
        if dressing.is_done:
            break
    return outcome(corners, arm, forces.peak_n)


def force_on_arm(sample: ContactsSample) -> np.ndarray:
    """Returns the sum of forces on the arm [N]."""
    return np.sum([(0.0, 0.0, 0.0), *(p.force for p in sample.points if p.link in ARM_SEGMENTS)], axis=0)


def main() -> int:
    """Runs the command; returns 1 if somebody is not dressed."""
    parser = argparse.ArgumentParser(description="Dresses people of chance, as fast as it goes and without ROS.")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0], metavar="N", help="one for each person, default 0")
    parser.add_argument("--force-limit", type=float, default=FORCE_LIMIT_N, metavar="N", help="on the arm [N]")
    parser.add_argument("--speed", type=float, default=SPEED, help="of the sleeve [m/s]")
    parser.add_argument("--out", type=Path, help="file for the outcomes, as JSON")
    arguments = parser.parse_args()
    if not (arguments.force_limit > 0.0 and arguments.speed > 0.0):
        parser.error("--force-limit and --speed: expected numbers above 0")
    outcomes = {}
    for seed in arguments.seeds:
        outcomes[seed] = found = run_trial(seed, arguments.force_limit, arguments.speed)
        words = "past the elbow" if found.is_dressed else "NOT past the elbow"
        print(f"seed {seed}: {words} ({found.past_elbow_m:.3f} m), peak force {found.peak_force_n:.2f} N", flush=True)
    if arguments.out:
        figures = {seed: {**found._asdict(), "is_dressed": found.is_dressed} for seed, found in outcomes.items()}
        arguments.out.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    return 0 if all(found.is_dressed for found in outcomes.values()) else 1
