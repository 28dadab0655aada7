"""The telepresence example without ROS: a robot pulls a sleeve over the arm that a simulated person holds out."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from operator_node.avatar.anthropometry import segment_offsets
from operator_node.avatar.joints import HINGES
from operator_node.avatar.retargeting import AvatarPose, Engagement, Retargeting
from operator_node.avatar.segment_forces import forces_by_segment
from operator_node.emulators.arm_held_out import RAISING_S, ArmHeldOut
from robot_model.geometry import Pose, Vector
from rpbi.samples import ContactsSample, SurfaceSample
from rpbi.world import World

from .cuff_path import ArmPosition
from .hand import TARGET_HZ, Dressing, HandSolver
from .outcome import ARM_SEGMENTS, ArmForce, Outcome, outcome, rings_of

WORLD = "{rpbi_examples}/configs/telepresence/config.yaml"
AVATAR_HEIGHT_M = 1.75
HEIGHTS_M = (1.60, 1.90)
"""Range of the random heights of persons [m]."""
FORCE_LIMIT_N, SPEED = 15.0, 0.1
MAX_DURATION_S = 30.0


def run_trial(seed: int, force_limit_n: float = FORCE_LIMIT_N, speed: float = SPEED) -> Outcome:
    """Runs the example as fast as possible and returns its result.

    Args:
        seed: Seed of the person's height and of the arm's pose.
        force_limit_n: Limit of the mean force on the whole arm [N]. Above the limit, the cuff moves back.
        speed: Speed of the cuff without contact [m/s].
    """
    world = World.from_file(WORLD)
    try:
        height_m = np.random.default_rng((seed, 1)).uniform(*HEIGHTS_M)
        trial = Trial(world, ArmHeldOut(height_m, seed), Dressing(speed), force_limit_n)
        while not trial.is_over:
            trial.step()
        return trial.outcome()
    finally:
        world.close()


class Trial:
    """One trial: a simulated person holds out an arm, and a robot pulls a sleeve over the arm.

    Args:
        world: World of the example, possibly with additional objects.
        person: Simulated person whose motion the human model in the world follows.
        dressing: The controller of the cuff.
        force_limit_n: Limit of the mean force on the whole arm [N].

    Attributes:
        force: Forces on the arm so far.
        cuff: Position of the middle of the cuff, shape (3,) [m].
    """

    def __init__(self, world: World, person: ArmHeldOut, dressing: Dressing, force_limit_n: float) -> None:
        self._world, self._person, self._dressing = world, person, dressing
        human: Any = world.bodies["human"]
        robot: Any = world.bodies["panda"]
        self._human, self._robot = human, robot
        self._retargeting = Retargeting(segment_offsets(AVATAR_HEIGHT_M))
        self._engagement = Engagement(max_joint_speed=3.0, max_speed=1.0, max_angular_speed=3.0)
        links = {human.link_name(index): index for index in range(-1, len(human.joint_indices))}
        self._links = [links[name] for name in ("RightUpperArm", "RightForeArm", "RightHand")]
        positions = _joint_positions(human)
        base = human.base_pose()
        first = np.array([positions[hinge] for hinge in HINGES])
        self._engagement.begin(AvatarPose(np.array(base.position), np.array(base.quat_xyzw), first))
        self._solver = HandSolver()
        self._corners: tuple[Vector, ...] = ()
        self._ticks = round(1.0 / (TARGET_HZ * world.clock.dt_s))
        self._number = 0
        self.force = ArmForce(force_limit_n)
        self.cuff = self._solver.cuff(self._positions())

    @property
    def time_s(self) -> float:
        """Time since the start of the trial [s]."""
        return self._number / TARGET_HZ

    @property
    def is_over(self) -> bool:
        """True if the controller is done, or if the trial has timed out."""
        return self._dressing.is_done or self.time_s >= MAX_DURATION_S

    def step(self) -> None:
        """Sends the next targets to the human model and the robot, and advances the world until new targets are due."""
        dt = 1.0 / TARGET_HZ
        pose = self._engagement.step(self._retargeting.pose(self._person.frame(self.time_s)), dt)
        self._world.put("human/pose", Pose(tuple(pose.position.tolist()), tuple(pose.quat_xyzw.tolist())))
        self._world.put("human/target", dict(zip(HINGES, pose.hinges.tolist())))
        arm = self._arm()
        self._world.put("elbow/pose", Pose(tuple(arm.elbow.tolist())))
        for _ in range(self._ticks):
            for sample in self._world.step():
                if isinstance(sample, ContactsSample) and sample.name == "human":
                    contacts = ((point.link, point.force) for point in sample.points if point.other_body != "human")
                    self.force.add(self._world.clock.time_s, forces_by_segment(ARM_SEGMENTS, contacts))
                elif isinstance(sample, SurfaceSample):
                    self._corners = sample.corners
        self.cuff = self._solver.cuff(now := self._positions())
        if self.time_s >= RAISING_S:
            target = self._dressing.target(arm, self.cuff, self.force.share, dt)
            if (found := self._solver.solve(target, now)) is not None:
                self._world.put("panda/target", found)
        self._number += 1

    def outcome(self) -> Outcome:
        """Computes the result from the present state of the sleeve and the arm."""
        return outcome(rings_of(self._corners), self._arm(), self.force)

    def _arm(self) -> ArmPosition:
        return ArmPosition(*(np.array(self._human.link_pose(link).position) for link in self._links))

    def _positions(self) -> tuple[float, ...]:
        positions = _joint_positions(self._robot)
        return tuple(positions[name] for name in self._solver.joint_names)


def _joint_positions(robot: Any) -> dict[str, float]:
    """Returns the positions of the movable joints [rad or m], indexed by joint name."""
    return dict(zip((joint.name for joint in robot.model.moving), robot.joint_positions().values()))


def main() -> int:
    """Runs a trial for each seed from the command line. Returns 0 if all persons were dressed, otherwise 1."""
    parser = argparse.ArgumentParser(description="Dresses random people, as fast as possible and without ROS.")
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
        force = f"peak force {found.peak_force_n:.2f} N, {found.peak_share:.0%} of a limit"
        print(f"seed {seed}: {words} ({found.past_elbow_m:.3f} m), {force}", flush=True)
    if arguments.out:
        figures = {seed: {**found._asdict(), "is_dressed": found.is_dressed} for seed, found in outcomes.items()}
        arguments.out.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    return 0 if all(found.is_dressed for found in outcomes.values()) else 1
