"""An arm wipes the stains off a tilted board with a sponge, and presses the sponge with a constant force."""

from __future__ import annotations

from collections.abc import Generator, Iterator

import numpy as np

from robot_model.geometry import Pose, dot, plus, quaternion_of, quaternion_product, rotated

from .parts.arm import LedArm
from .parts.lanes import Patch, Stamp, lanes, middles, share_of_way
from .scene import Scene, SceneFailedError, Watched

URDF, SPONGE = "{rpbi_examples}/robots/kuka_lwr_sponge.urdf", "end_effector_sponge"
ARM = "kuka_lwr", URDF, "lwr_arm_0_link", SPONGE, Pose((0.5, 0.0, 0.0))
"""Robot, URDF, base link, sponge link, and pose of the base, as in configs/basic_example_kuka_lwr/kuka_lwr.yaml."""
FACING = (1.0, 0.0, 0.0, 0.0)
"""Orientation of the sponge on the board: its z axis points into the board."""
PIVOT, FACE_M = (-0.16, 0.0, 0.15), 0.06
"""Position of the ball joint under the board in the world, and height of the board's face above the joint [m]."""
RANGES = ((-0.02, -0.02, -0.1, 0.3, -0.15, 2000.0, 0.4), (0.02, 0.02, 0.1, 0.5, 0.15, 5000.0, 1.0))
"""Lower and upper bounds of the random values: shift of the board along x and y [m], rotation of the board about x, y
and z [rad], stiffness of the sponge [N/m], friction.
"""
SIZE_M, STAINS, CELLS, STAIN_M = (0.25, 0.36), (8, 10), (50, 72), 0.009
"""Extents of the dirty area along x and y [m], grid of stains, grid of cells for coverage, radius of a stain [m]."""
LANES, LENGTH_M, PITCH_M, SPEED = 3, 0.36, 0.084, 0.15
"""Path of the sponge: number of lanes, length of a lane [m], distance between lanes [m], speed [m/s]. The lanes are so
near that each stain is completely under the sponge in one of the lanes.
"""
OVER_M, PATIENCE_S = 0.05, 4.0
"""Height of the sponge above the board before and after wiping [m], and timeout for reaching the force [s]."""
FORCES_N, TOLERANCE, LEAST_WAY, LEAST_STAINS = (15.0, 25.0), 0.1, 0.95, 0.99
"""Range of the desired force [N], its largest relative error, least share of the path within this error, and least
share of removed stains.
"""


class Wiping(Scene):
    """A KUKA LWR4+ wipes a board lane by lane with a sponge. A controller keeps the normal force constant.

    Attributes:
        force: Desired normal force [N].
        stains: Position x, y of each stain on the board, shape (2,) [m], indexed by name.
        left: Names of the stains that are not removed yet.
        stamps: Pose of the sponge on the board in each cycle of wiping.
        forces: Normal force of the sponge in each cycle of wiping [N].
        covered: Which cells of the board were wiped, booleans of shape `CELLS`.
    """

    world = "{rpbi_examples}/configs/wiping/config.yaml"
    watch = Watched(robots=("kuka_lwr",), bodies=("board",), contacts=("board",))
    hands = {"kuka_lwr/wipe": SPONGE}

    def __init__(self, random: np.random.Generator) -> None:
        super().__init__(random)
        self.force = float(random.uniform(*FORCES_N))
        self.goal_numbers = (self.force,)
        self.stains = {
            f"stain_{number:02d}": middle + random.uniform(-0.4, 0.4, 2) * SIZE_M / STAINS
            for number, middle in enumerate(middles(SIZE_M, STAINS).reshape(-1, 2))
        }
        self.left = list(self.stains)
        self.stamps: list[Stamp] = []
        self.forces: list[float] = []
        self.covered = np.zeros(CELLS, bool)

    def prepare(self) -> None:
        """Puts the board with its stains at a random pose, and sets random stiffness and friction of the sponge."""
        x, y, about_x, about_y, yaw, stiffness, friction = self.random.uniform(*RANGES).tolist()
        turn = quaternion_product(quaternion_of((0.0, 0.0, yaw)), quaternion_of((about_x, about_y, 0.0)))
        board = Pose(plus(PIVOT, rotated(turn, (x, y, FACE_M))), turn)
        self.place("board", board)
        for name, place in self.stains.items():
            self.place(name, board @ Pose((*place.tolist(), 0.0005)))
        self.change("board", lateralFriction=friction)
        self.change(f"kuka_lwr/{SPONGE}", contactStiffness=stiffness, contactDamping=100.0)

    def act(self) -> Iterator[None]:
        """Moves the sponge above the board, presses, wipes lane by lane, and retreats."""
        path = lanes(LANES, LENGTH_M, PITCH_M, SPEED * 0.02).tolist()
        arm = yield from self._press(*path[0])
        board = self.sensed.poses["board"]
        for x, y in path:
            self.put("kuka_lwr/wipe/target", board @ Pose((x, y, 0.0), FACING))
            yield
            self._wipe(arm.pose())
        self.switch("kuka_lwr", stop=("wipe",))
        yield
        arm = LedArm(self, *ARM)
        yield from arm.go(arm.target @ Pose((0.0, 0.0, -OVER_M)), 1.0)

    def beside(self) -> Iterator[None]:
        """Presses the sponge onto the board at the start of the lanes. Then records the wiping while a policy moves the
        sponge.
        """
        arm = yield from self._press(*lanes(LANES, LENGTH_M, PITCH_M, SPEED * 0.02)[0].tolist())
        while True:
            yield
            self._wipe(arm.pose())

    def has_succeeded(self) -> bool:
        """Returns whether enough of the path was wiped with the desired force, and enough stains are removed."""
        return self._held() >= LEAST_WAY and self._gone() >= LEAST_STAINS

    def figures(self) -> dict[str, float]:
        """Returns desired and mean force, share of the path with the desired force, removed stains, and coverage."""
        return {
            "force [N]": self.force,
            "mean force [N]": float(np.mean(self.forces or [0.0])),
            "way within 10 % [%]": 100.0 * self._held(),
            "stains gone [%]": 100.0 * self._gone(),
            "coverage [%]": 100.0 * float(self.covered.mean()),
        }

    def _press(self, x: float, y: float) -> Generator[None, None, LedArm]:
        """Moves the sponge above a position on the board, presses, and returns the arm.

        Args:
            x: x of the position in the board's frame [m].
            y: y of the position in the board's frame [m].

        Raises:
            SceneFailedError: If the force is not reached within `PATIENCE_S`.
        """
        board, arm = self.sensed.poses["board"], LedArm(self, *ARM)
        yield from arm.go(board @ Pose((x, y, OVER_M), FACING), 2.0)
        self.tune("kuka_lwr/wipe", axis=rotated(board.quat_xyzw, (0.0, 0.0, -1.0)), force=self.force)
        self.switch("kuka_lwr", start=("wipe",))
        end_s = self.seen.time_s + PATIENCE_S
        while not self._is_held(self._normal_force()):
            if self.seen.time_s > end_s:
                raise SceneFailedError(f"expected to press with {self.force:.1f} N, got {self._normal_force():.1f} N")
            yield
        yield from self.wait(0.3)
        return arm

    def _wipe(self, sponge: Pose) -> None:
        """Records pose and force of the sponge. Removes covered stains if the force is within the tolerance."""
        board, force = self.seen.poses["board"], self._normal_force()
        self.stamps.append(Stamp.of(board.inverse() @ sponge))
        self.forces.append(force)
        if self._is_held(force):
            touching = [touch.position for touch in self.seen.contacts["board"] if touch.other == ARM[0]]
            patch = Patch.of(board, touching)
            self.covered |= patch.covers(middles(SIZE_M, CELLS))
            for name in [name for name in self.left if patch.covers(self.stains[name], STAIN_M)]:
                self.left.remove(name)
                self.vanish(name)

    def _normal_force(self) -> float:
        """Returns the total contact force on the board, perpendicular to the board's face [N]."""
        down = rotated(self.seen.poses["board"].quat_xyzw, (0.0, 0.0, -1.0))
        return sum(touch.normal_force * dot(touch.normal, down) for touch in self.seen.contacts["board"])

    def _is_held(self, force: float) -> bool:
        return abs(force - self.force) <= TOLERANCE * self.force

    def _held(self) -> float:
        """Returns the share of the path along which the force was within the tolerance."""
        return share_of_way(self.stamps, [self._is_held(force) for force in self.forces])

    def _gone(self) -> float:
        """Returns the number of removed stains divided by the number of all stains."""
        return 1.0 - len(self.left) / len(self.stains)
