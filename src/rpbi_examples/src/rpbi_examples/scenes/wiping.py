"""An arm wipes the stains off a tilted board with a sponge, and presses with a constant force."""

from __future__ import annotations

from collections.abc import Generator, Iterator

import numpy as np

from robot_model.geometry import Pose, dot, plus, quaternion_of, quaternion_product, rotated

from .parts.arm import LedArm
from .parts.lanes import Patch, Stamp, lanes, middles, share_of_way
from .scene import Scene, SceneFailedError, Watched

URDF, SPONGE = "{rpbi_examples}/robots/kuka_lwr_sponge.urdf", "end_effector_sponge"
ARM = "kuka_lwr", URDF, "lwr_arm_0_link", SPONGE, Pose((0.5, 0.0, 0.0))
"""The arm, its chain and its base in the world, as in configs/basic_example_kuka_lwr/kuka_lwr.yaml."""
FACING = (1.0, 0.0, 0.0, 0.0)
"""Orientation of the sponge on the board: its z axis points into the board."""
PIVOT, FACE_M = (-0.16, 0.0, 0.15), 0.06
"""Ball joint of the board's support in the world [m], and height of the board's face over it."""
RANGES = ((-0.02, -0.02, -0.1, 0.3, -0.15, 2000.0, 0.4), (0.02, 0.02, 0.1, 0.5, 0.15, 5000.0, 1.0))
"""Shift of the board along x and y [m], rotations about x, y and z [rad], stiffness of the sponge [N/m], friction."""
SIZE_M, STAINS, CELLS, STAIN_M = (0.25, 0.36), (8, 10), (50, 72), 0.009
"""Extents of the dirty area of the board; its grid of stains, and grid of cells for coverage; radius of a stain."""
LANES, LENGTH_M, PITCH_M, SPEED = 3, 0.36, 0.084, 0.15
"""The path, and the speed along it [m/s]; each stain is wholly under the sponge in one of the lanes."""
OVER_M, PATIENCE_S = 0.05, 4.0
"""Height of the sponge over the board before and afterwards; longest time until it presses [s]."""
FORCES_N, TOLERANCE, LEAST_WAY, LEAST_STAINS = (15.0, 25.0), 0.1, 0.95, 0.99
"""Range of the force and its largest error; shares of the path with that force and of removed stains for success."""


class Wiping(Scene):
    """A KUKA LWR4+ wipes a board lane by lane; a controller in the tick holds the force.

    Attributes:
        force: Desired normal force [N].
        stains: Places of all stains on the board by name, shape (2,) [m].
        left: Stains that remain.
        stamps: Where the sponge was on the board, by cycle of the path.
        forces: Normal force of the sponge in these cycles [N].
        covered: Which cells of the board were wiped.
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
        """Tilts the board and its stains, and chooses stiffness and friction of the sponge."""
        x, y, about_x, about_y, yaw, stiffness, friction = self.random.uniform(*RANGES).tolist()
        turn = quaternion_product(quaternion_of((0.0, 0.0, yaw)), quaternion_of((about_x, about_y, 0.0)))
        board = Pose(plus(PIVOT, rotated(turn, (x, y, FACE_M))), turn)
        self.place("board", board)
        for name, place in self.stains.items():
            self.place(name, board @ Pose((*place.tolist(), 0.0005)))
        self.change("board", lateralFriction=friction)
        self.change(f"kuka_lwr/{SPONGE}", contactStiffness=stiffness, contactDamping=100.0)

    def act(self) -> Iterator[None]:
        """Moves above the board, presses, wipes lane by lane, and retreats."""
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
        """Presses the sponge onto the corner where lanes begin, and then records its motion by a policy."""
        arm = yield from self._press(*lanes(LANES, LENGTH_M, PITCH_M, SPEED * 0.02)[0].tolist())
        while True:
            yield
            self._wipe(arm.pose())

    def has_succeeded(self) -> bool:
        """Returns whether the force was held along the path, and the stains are removed."""
        return self._held() >= LEAST_WAY and self._gone() >= LEAST_STAINS

    def figures(self) -> dict[str, float]:
        """Returns figures of the sponge's force and coverage."""
        return {
            "force [N]": self.force,
            "mean force [N]": float(np.mean(self.forces or [0.0])),
            "way within 10 % [%]": 100.0 * self._held(),
            "stains gone [%]": 100.0 * self._gone(),
            "coverage [%]": 100.0 * float(self.covered.mean()),
        }

    def _press(self, x: float, y: float) -> Generator[None, None, LedArm]:
        """Moves above a place of the board [m], and presses there; returns the arm."""
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
        """Records place and force of the sponge, and removes stains that it touches completely."""
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
        """Returns the force on the board, into its face [N]."""
        down = rotated(self.seen.poses["board"].quat_xyzw, (0.0, 0.0, -1.0))
        return sum(touch.normal_force * dot(touch.normal, down) for touch in self.seen.contacts["board"])

    def _is_held(self, force: float) -> bool:
        return abs(force - self.force) <= TOLERANCE * self.force

    def _held(self) -> float:
        """Returns the share of the path along which the force was held."""
        return share_of_way(self.stamps, [self._is_held(force) for force in self.forces])

    def _gone(self) -> float:
        """Returns the share of removed stains."""
        return 1.0 - len(self.left) / len(self.stains)
