"""A simulated person, who moves the arms of an avatar: the right hand holds out its palm, and the left hand waves."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from robot_model.geometry import Pose, plus, quaternion_of, quaternion_product
from rpbi_examples.scenes.scene import Scene

from .arm import LedArm, between, smooth
from .holding import RestDetector

NAME, URDF, ROOT = "human", "{rpbi_examples}/robots/human_hands.urdf", Pose((0.0, 0.0, 0.9275))
"""Name of the avatar in the world, the avatar's URDF file, and the pose of its trunk in the world."""
LEFT_HAND = Pose((0.0, 0.36, 0.0))
"""Middle of the left hand in the frame of the left forearm [m]."""
OUT_X_M, CALM_M = 0.34, 0.008
"""The palm counts as held out if its x exceeds the first value, and as at rest if it moves less than the second [m]."""
SWAY_HZ, TREMOR_HZ = 0.4, 8.0
SWAY_M, TREMOR_M, SWAY_RAD = 2.5e-3, 2e-4, 0.01
"""Amplitudes of sway and tremor along each axis [m], and of the sway about each axis [rad]."""
RAISED = {"Shoulder_rotx": -35.0, "Shoulder_roty": -90.0, "Elbow_rotz": -115.0}
"""Joint angles of the raised left arm [deg]. Joints without a value are at 0."""
WAVE_DEG, WAVE_S, RAISE_S = 25.0, 0.8, 1.0
"""Amplitude of the elbow [deg], period of a wave [s], and time for raising or lowering the arm [s]."""
SHOULDER_M, MIDDLE_M, SWING_M = 1.43, 0.55, 0.08
"""Detection of swings [m]: height above which the left hand counts as raised, y of the middle of a swing, and least
distance of the hand from the middle on each side.
"""


class SwayingPerson:
    """Moves both arms of an avatar. The right palm sways like the hand of a standing person.

    Args:
        scene: Scene in which the avatar acts.
        random: Random generator for the phases of the sway.

    Attributes:
        target: Pose around which the right palm sways, in the world: z out of the palm, x along the fingers.
        swings: Number of times that the raised left hand has moved from one side to the other. The number is measured,
            not commanded.
    """

    def __init__(self, scene: Scene, random: np.random.Generator) -> None:
        self._scene = scene
        self._right = LedArm(scene, NAME, URDF, "Trunk", "RightPalm", ROOT)
        self._left = LedArm(scene, NAME, URDF, "Trunk", "LeftForeArm", ROOT)
        self._phases = random.uniform(0.0, 2.0 * math.pi, (3, 3))
        self.target = self._right.target
        self.swings, self._side, self._calm = 0, 0.0, RestDetector()

    def palm(self) -> Pose:
        """Returns the present pose of the right palm in the world."""
        return self._right.pose()

    def note(self) -> None:
        """Records the positions of both hands in this cycle, and counts the swings."""
        self._calm.note(self.palm().position)
        _, y, z = (self._left.pose() @ LEFT_HAND).position
        if z > SHOULDER_M and abs(y - MIDDLE_M) > SWING_M:
            side = math.copysign(1.0, y - MIDDLE_M)
            self.swings += side == -self._side
            self._side = side

    def holds_out(self) -> bool:
        """Returns whether the right palm is held out and at rest."""
        return self.palm().position[0] > OUT_X_M and self._calm.is_within(CALM_M)

    def go(self, pose: Pose, duration_s: float) -> Iterator[None]:
        """Moves the right palm along a line to a pose in the world, from rest to rest.

        Raises:
            SceneFailedError: If the pose is out of reach.
        """
        start, begin_s = self.target, self._scene.seen.time_s
        while (share := (self._scene.seen.time_s - begin_s) / duration_s) < 1.0:
            self._send(between(start, pose, smooth(share)))
            yield

    def stay_until(self, is_over: Callable[[], bool]) -> Iterator[None]:
        """Keeps the right palm at its last target until a condition holds."""
        while not is_over():
            self._send(self.target)
            yield

    def wave(self, count: int) -> Iterator[None]:
        """Raises the left arm, waves `count` times, and lowers the arm."""
        joints = self._left.joint_names
        down = [self._scene.seen.joints[NAME][name] for name in joints]
        up = [math.radians(RAISED.get(name.removeprefix("jLeft"), 0.0)) for name in joints]
        yield from self._left.move_joints(up, RAISE_S)
        elbow, begin_s = joints.index("jLeftElbow_rotz"), self._scene.seen.time_s
        while (time_s := self._scene.seen.time_s - begin_s) < count * WAVE_S:
            swing = math.radians(WAVE_DEG) * math.sin(2.0 * math.pi * time_s / WAVE_S)
            self._scene.put(f"{NAME}/target", {joints[elbow]: up[elbow] + swing})
            yield
        yield from self._left.move_joints(down, RAISE_S)

    def _send(self, pose: Pose) -> None:
        """Sends the right palm to a pose in the world, with sway and tremor added."""
        self.target = pose
        sway, tremor, turn = (
            np.sin(2.0 * math.pi * hz * self._scene.seen.time_s + phases)
            for hz, phases in zip((SWAY_HZ, TREMOR_HZ, SWAY_HZ), self._phases)
        )
        x, y, z = (SWAY_M * sway + TREMOR_M * tremor).tolist()
        tilt = quaternion_of(tuple((SWAY_RAD * turn).tolist()))
        self._right.send(Pose(plus(pose.position, (x, y, z)), quaternion_product(tilt, pose.quat_xyzw)))


def together(*acts: Iterator[None]) -> Iterator[None]:
    """Runs several actions at the same time until all have ended. In each cycle, the actions advance in order."""
    running = list(acts)
    while running := [act for act in running if next(act, running) is None]:
        yield
