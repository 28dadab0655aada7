"""Two arms press a box between their flanges, carry the box to a goal and put the box down."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from robot_model.geometry import Pose, Vector, angle_between, dot, minus, norm, plus, rotated

from .parts.arm import about_z, between, smooth, tilt_deg
from .scene import Scene, Touch, Watched

HALF_WIDTH_M, TABLE_M, HALF_HEIGHT_M = 0.15, 0.45, 0.1
"""Half the distance between the pressed faces, height of the table, half the height of the box [m]."""
STIFFNESS = 3000.0
"""Stiffness of the hands, as in configs/dual_arm/iiwa.yaml [N/m]."""
FORCE_N, MAX_CHANGE = 80.0, 0.3
"""Internal force with which the hands press the box [N], and its largest relative error in 95 % of the cycles."""
MASSES_KG = (1.0, 3.0)
LIFT_M = 0.2
SPEED = 0.1
"""Mean speed of the box [m/s]."""
SHORTEST_S, CYCLE_S = 1.5, 0.02
"""Least duration of a motion, and duration of a cycle [s]."""
NEAR_M, NEAR_RAD = 0.02, math.radians(5.0)
"""Distance [m] and angle [rad] from the goal within which the box counts as at its goal."""
MAX_TILT_DEG = 3.0
FLANGES = {
    "left": (1.0, (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))),
    "right": (-1.0, (-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))),
}
"""For each arm: sign of the box's y axis on the arm's side, and the flange's orientation in the box's frame. The z axis
of a flange points at the box.
"""


class DualArm(Scene):
    """Two KUKA iiwa arms press a box between their flanges with a constant force, and carry the box to a goal."""

    world = "{rpbi_examples}/configs/dual_arm/config.yaml"
    watch = Watched(robots=("left", "right"), bodies=("box",), contacts=("box",))
    hands = {f"{robot}/hold": "lbr_iiwa_link_7" for robot in FLANGES}

    def __init__(self, random: np.random.Generator) -> None:
        super().__init__(random)
        self.goal = _on_table(random)
        self.goal_numbers = (*self.goal.position, *self.goal.quat_xyzw)
        self._tilt_deg, self._is_carrying = 0.0, False
        self._forces: list[float] = []
        self._shares: list[float] = []

    def prepare(self) -> None:
        """Puts a box with a random mass at a random pose on the table."""
        self.place("box", _on_table(self.random))
        self.change("box", mass=float(self.random.uniform(*MASSES_KG)))

    def act(self) -> Iterator[None]:
        """Makes both arms approach the box, press, lift, carry, lower and release the box."""
        start = self.sensed.poses["box"]
        for share in np.linspace(0.0, 1.0, 75):
            self._hold(start, 0.12 - 0.10 * smooth(share))
            yield
        for share in np.linspace(0.0, 1.0, 50):
            self._hold(start, 0.02 * (1.0 - share) - share * FORCE_N / STIFFNESS)
            yield
        self._is_carrying = True
        above, end = (pose._replace(position=plus(pose.position, (0.0, 0.0, LIFT_M))) for pose in (start, self.goal))
        for first, second in ((start, above), (above, end), (end, self.goal)):
            yield from self._carry(first, second)
        self._is_carrying = False
        for share in np.linspace(0.0, 1.0, 75):
            self._hold(self.goal, -(1.0 - share) * FORCE_N / STIFFNESS + 0.12 * smooth(share))
            yield

    def beside(self) -> Iterator[None]:
        """Determines in each cycle whether the box is carried. A box counts as carried if it does not touch the table.

        `note` records forces only while the box is carried.
        """
        while True:
            self._is_carrying = "table" not in self._touching()
            yield

    def note(self) -> None:
        """Records the tilt of the box. While the box is carried, also records the forces of both arms."""
        self._tilt_deg = max(self._tilt_deg, tilt_deg(self.seen.poses["box"]))
        if self._is_carrying:
            self._forces.append(min(self._pressure(robot) for robot in FLANGES))
            left, right = (sum(touch.force[2] for touch in self._touches(robot)) for robot in FLANGES)
            self._shares.append(left / max(left + right, 1.0))

    def has_succeeded(self) -> bool:
        """Returns whether the box stayed level, was pressed with the desired force, and is released at its goal."""
        off_m, off_rad = self._error()
        is_there = off_m < NEAR_M and off_rad < NEAR_RAD and self._touching() == {"table"}
        is_held = np.quantile(np.abs(np.array(self._forces or [0.0]) - FORCE_N), 0.95) < MAX_CHANGE * FORCE_N
        return bool(is_there and is_held) and self._tilt_deg < MAX_TILT_DEG

    def fault(self) -> str:
        """Returns a text with the distance of the box from its goal. Empty if the box is near its goal."""
        off_m, _ = self._error()
        return "" if off_m < NEAR_M else f"the box slipped: it is {1e3 * off_m:.0f} mm from its goal"

    def figures(self) -> dict[str, float]:
        """Returns the box's final error and largest tilt, the range of the pressing force, and the left arm's share of
        the load.
        """
        off_m, off_rad = self._error()
        low, high = np.quantile(self._forces or [0.0], (0.025, 0.975))
        return {
            "error [mm]": 1e3 * off_m,
            "turned by [deg]": math.degrees(off_rad),
            "largest tilt [deg]": self._tilt_deg,
            "force from [N]": float(low),
            "to [N]": float(high),
            "left carries [%]": 100.0 * float(np.mean(self._shares or [0.0])),
        }

    def _hold(self, box: Pose, gap_m: float) -> None:
        """Sends both flanges to their sides of the box.

        Args:
            box: Desired pose of the box in the world.
            gap_m: Distance between each flange and the box [m]. A negative distance presses the box.
        """
        for robot, (side, turn) in FLANGES.items():
            place = (0.0, side * (HALF_WIDTH_M + gap_m), 0.0)
            self.put(f"{robot}/hold/target", box @ Pose(place, turn))

    def _carry(self, start: Pose, end: Pose) -> Iterator[None]:
        """Moves the pressed box along a line from one pose to another, from rest to rest."""
        count = round(max(norm(minus(end.position, start.position)) / SPEED, SHORTEST_S) / CYCLE_S)
        for share in np.linspace(0.0, 1.0, count):
            self._hold(between(start, end, smooth(share)), -FORCE_N / STIFFNESS)
            yield

    def _pressure(self, robot: str) -> float:
        """Returns the magnitude of the force of an arm on the box along the box's y axis [N]."""
        axis: Vector = rotated(self.seen.poses["box"].quat_xyzw, (0.0, 1.0, 0.0))
        return abs(sum(touch.normal_force * dot(touch.normal, axis) for touch in self._touches(robot)))

    def _touching(self) -> set[str]:
        return {touch.other for touch in self.seen.contacts["box"]}

    def _touches(self, robot: str) -> list[Touch]:
        return [touch for touch in self.seen.contacts["box"] if touch.other == robot]

    def _error(self) -> tuple[float, float]:
        box = self.seen.poses["box"]
        return norm(minus(box.position, self.goal.position)), angle_between(box.quat_xyzw, self.goal.quat_xyzw)


def _on_table(random: np.random.Generator) -> Pose:
    """Returns a random pose of the box on the table."""
    x, y, yaw = random.uniform((0.5, -0.08, -0.25), (0.6, 0.08, 0.25)).tolist()
    return Pose((x, y, TABLE_M + HALF_HEIGHT_M), about_z(yaw))
