"""Motion of a person who walks in a circle and reaches forward with both hands in turn, as 23 segments."""

import numpy as np
from scipy.spatial.transform import Rotation

from custom_ros_tools.transforms import Array
from operator_node.mvn.segments import INDEX, PARENTS, SEGMENTS

T_POSE = {
    "Pelvis": (0.0, 0.0, 0.530),
    "L5": (0.0, 0.0, 0.575),
    "L3": (0.0, 0.0, 0.630),
    "T12": (0.0, 0.0, 0.680),
    "T8": (0.0, 0.0, 0.735),
    "Neck": (0.0, 0.0, 0.820),
    "Head": (0.0, 0.0, 0.870),
    "RightShoulder": (0.0, -0.020, 0.810),
    "RightUpperArm": (0.0, -0.110, 0.810),
    "RightForeArm": (0.0, -0.296, 0.810),
    "RightHand": (0.0, -0.442, 0.810),
    "RightUpperLeg": (0.0, -0.055, 0.530),
    "RightLowerLeg": (0.0, -0.055, 0.285),
    "RightFoot": (0.0, -0.055, 0.039),
    "RightToe": (0.100, -0.055, 0.010),
}
"""Origins of the segments of the trunk and the right side in the T-pose, as fractions of the body height.

Lengths of arms and legs and heights of joints are those of Drillis and Contini (1966), as in Winter, Biomechanics and
Motor Control of Human Movement. The joints of the back are distributed between hips and shoulders.
"""
STANCE = 0.62
"""Share of a stride during which a foot is on the floor."""
LIFT = 0.06
"""Height to which a foot is lifted, as a fraction of the body height."""
REACHING_S, REACH_PERIOD_S = 2.5, 5.0
"""Duration of a reach, and time from its start to the start of the other hand's reach [s]."""
SETTLING_S, CROUCHING_S = 1.5, 0.8
"""Time in which the arms leave the T-pose, and time in which the knees bend before the first step [s]."""
STRIDE_S = 1.2
BOB = 0.006
"""Amplitude of the pelvis' vertical motion, as a fraction of the body height."""


class WalkingPerson:
    """Motion of a walking person as a function of time. Feet do not slide, bones are rigid, and knees bend forwards.

    Args:
        height_m: Body height [m].
        speed: Walking speed [body heights/s]; with 0, the person stands.
        radius_m: Radius of the circle, which curves to the left [m].
        t_pose_s: Time for which the person stands in the T-pose at the start [s].
        start: Position of the person in the T-pose, x and y [m].
        reach: Whether the hands reach forward in turn.
    """

    def __init__(
        self,
        height_m: float = 1.75,
        speed: float = 0.4,
        radius_m: float = 1.5,
        t_pose_s: float = 3.0,
        start: tuple[float, float] = (0.0, 0.0),
        reach: bool = True,
    ) -> None:
        self._speed_m_s, self._radius_m, self._t_pose_s = speed * height_m, radius_m, t_pose_s
        self._start, self._reaches, self._height_m = np.array((*start, 0.0)), reach, height_m
        self.t_pose = height_m * np.array([_origin(name) for name in SEGMENTS])
        """Origins of the segments in the T-pose (23 x 3) [m]. All segments then have the orientation of the world."""
        self._offsets = np.array([self.t_pose[i] - self.t_pose[max(parent, 0)] for i, parent in enumerate(PARENTS)])
        leg = T_POSE["RightUpperLeg"][2] - T_POSE["RightFoot"][2]
        longest_step = 0.5 * STANCE * STRIDE_S * speed
        """Distance of a foot behind the hip at the end of its stance, as a fraction of the body height."""
        self._crouch_m = height_m * (leg - (leg**2 - longest_step**2) ** 0.5 + BOB + 0.01)

    def pose(self, time_s: float) -> tuple[Array, Array]:
        """Returns the segments' origins (23 x 3) [m] and orientations (23 x 4), x, y, z, w, at a time [s]."""
        walking_s = time_s - self._t_pose_s
        ready = _smooth(walking_s / SETTLING_S)
        phase = 2.0 * np.pi * walking_s / STRIDE_S
        striding = ready if self._speed_m_s else 0.0
        distance_m = self._distance_m(walking_s)
        crouch_m = _smooth(walking_s / CROUCHING_S) * self._crouch_m
        pelvis = self._on_path(distance_m) + (0.0, 0.0, self.t_pose[0][2] - crouch_m)
        pelvis[2] += striding * BOB * self._height_m * np.cos(2.0 * phase)
        facing = Rotation.from_euler("z", distance_m / self._radius_m)
        sway = striding * np.sin(phase)
        turns = {"Pelvis": facing * Rotation.from_euler("z", 0.06 * sway)}
        for name, share in (("L5", 0.2), ("L3", 0.4), ("T12", 0.6), ("T8", 0.8), ("Neck", 0.4), ("Head", 0.0)):
            turns[name] = facing * Rotation.from_euler("zy", (-0.12 * share * sway, 0.06 * share * ready))
        for side, sign in (("Right", -1.0), ("Left", 1.0)):
            self._turn_arm(turns, side, sign, walking_s, ready, sway)
        positions, quats = self._forward(pelvis, turns)
        for side, sign, offset in (("Right", -1.0, 0.0), ("Left", 1.0, 0.5)):
            hip = positions[0] + turns["Pelvis"].apply(self._offsets[INDEX[f"{side}UpperLeg"]])
            self._place_leg(positions, quats, side, hip, *self._ankle(walking_s, sign, offset))
        return positions, quats

    def _turn_arm(
        self, turns: dict[str, Rotation], side: str, sign: float, walking_s: float, ready: float, sway: float
    ) -> None:
        reach = ready * self._reach(walking_s, sign)
        swing = 0.35 * -sign * sway * (1.0 - reach)
        forward = (1.25 + 0.15 * np.sin(0.9 * walking_s)) * reach + swing + 0.1 * ready * (1.0 - reach)
        down = ready * (1.45 - 0.1 * reach)
        shoulder = turns["T8"]
        upper = shoulder * Rotation.from_euler("y", -forward) * Rotation.from_euler("x", -sign * down)
        bend = ready * (0.35 * (1.0 - reach) + 0.25 * reach) + 0.15 * abs(swing)
        fore = upper * Rotation.from_euler("z", -sign * bend)
        hand = fore * Rotation.from_euler("z", -sign * 0.1 * ready)
        for segment, turn in (("Shoulder", shoulder), ("UpperArm", upper), ("ForeArm", fore), ("Hand", hand)):
            turns[f"{side}{segment}"] = turn

    def _reach(self, walking_s: float, sign: float) -> float:
        """Returns how far a hand reaches forward, from 0 to 1. `sign` is -1 for the right hand, 1 for the left."""
        number, since_s = divmod(walking_s - SETTLING_S, REACH_PERIOD_S)
        if not self._reaches or number < 0 or number % 2 != (sign > 0) or since_s > REACHING_S:
            return 0.0
        return float(np.sin(np.pi * since_s / REACHING_S) ** 2)

    def _distance_m(self, walking_s: float) -> float:
        """Returns the distance walked in the first `walking_s` seconds [m]. The speed grows smoothly from 0."""
        walking_s = max(walking_s - CROUCHING_S, 0.0)
        return float(self._speed_m_s * (walking_s - SETTLING_S * -np.expm1(-walking_s / SETTLING_S)))

    def _on_path(self, distance_m: float) -> Array:
        angle, radius = distance_m / self._radius_m, self._radius_m
        return self._start + radius * np.array((np.sin(angle), 1.0 - np.cos(angle), 0.0))

    def _footprint(self, number: float, sign: float, offset: float) -> tuple[Array, float]:
        """Returns the ankle's position [m] and the foot's yaw [rad] while the foot is on the floor in a stride.

        Args:
            number: Index of the stride.
            sign: -1 for the right foot, 1 for the left foot.
            offset: Time at which the foot's first stride starts, in strides.
        """
        distance_m = self._distance_m((number + offset + STANCE / 2.0) * STRIDE_S)
        angle = distance_m / self._radius_m
        aside = -sign * self._height_m * T_POSE["RightUpperLeg"][1]
        place = self._on_path(distance_m) + aside * np.array((-np.sin(angle), np.cos(angle), 0.0))
        return place + (0.0, 0.0, self._height_m * T_POSE["RightFoot"][2]), angle

    def _ankle(self, walking_s: float, sign: float, offset: float) -> tuple[Array, float]:
        """Returns an ankle's position [m] and the foot's yaw [rad] at the time `walking_s` since the first step [s].

        For the other arguments see `_footprint`.
        """
        number, part = divmod(walking_s / STRIDE_S - offset, 1.0)
        here, direction = self._footprint(number, sign, offset)
        if part < STANCE:
            return here, direction
        there, next_direction = self._footprint(number + 1, sign, offset)
        swing = (part - STANCE) / (1.0 - STANCE)
        share = _smooth(swing)
        step = min(1.0, float(np.linalg.norm(there - here)) / (0.1 * self._height_m))
        lift = (0.0, 0.0, step * LIFT * self._height_m * np.sin(np.pi * share) ** 2)
        return here + share * (there - here) + lift, direction + share * (next_direction - direction)

    def _place_leg(
        self, positions: Array, quats: Array, side: str, hip: Array, ankle: Array, direction_rad: float
    ) -> None:
        """Sets the poses of thigh, shank, foot and toe for positions of hip and ankle [m]. The knee bends forward."""
        upper, lower, foot, toe = (INDEX[f"{side}{name}"] for name in ("UpperLeg", "LowerLeg", "Foot", "Toe"))
        thigh_m, shank_m = (float(np.linalg.norm(self._offsets[each])) for each in (lower, foot))
        reach = ankle - hip
        distance_m = min(float(np.linalg.norm(reach)), thigh_m + shank_m)
        down = reach / np.linalg.norm(reach)
        left = np.array((-np.sin(direction_rad), np.cos(direction_rad), 0.0))
        left -= left @ down * down
        left /= np.linalg.norm(left)
        ahead = np.cross(down, left)
        cosine = (thigh_m**2 + distance_m**2 - shank_m**2) / (2.0 * thigh_m * distance_m)
        bend = np.arccos(np.clip(cosine, -1.0, 1.0))
        thigh = np.cos(bend) * down + np.sin(bend) * ahead
        knee = hip + thigh_m * thigh
        shank = (ankle - knee) / np.linalg.norm(ankle - knee)
        flat = Rotation.from_euler("z", direction_rad)
        positions[[upper, lower, foot]] = hip, knee, knee + shank_m * shank
        positions[toe] = positions[foot] + flat.apply(self._offsets[toe])
        for index, bone in ((upper, thigh), (lower, shank)):
            quats[index] = Rotation.from_matrix(np.array((np.cross(left, -bone), left, -bone)).T).as_quat()
        quats[[foot, toe]] = flat.as_quat()

    def _forward(self, pelvis: Array, turns: dict[str, Rotation]) -> tuple[Array, Array]:
        """Returns origins and orientations of all segments except the legs, by forward kinematics."""
        positions, quats = np.zeros((len(SEGMENTS), 3)), np.zeros((len(SEGMENTS), 4))
        for index, (name, parent) in enumerate(zip(SEGMENTS, PARENTS)):
            if name in turns:
                offset = turns[SEGMENTS[max(parent, 0)]].apply(self._offsets[index])
                positions[index] = pelvis if parent < 0 else positions[parent] + offset
                quats[index] = turns[name].as_quat()
        return positions, quats


def _origin(name: str) -> Array:
    """Returns the origin of a segment in the T-pose, as fractions of the body height. The left side is mirrored."""
    if name in T_POSE:
        return np.array(T_POSE[name])
    return np.array(T_POSE[name.replace("Left", "Right")]) * (1.0, -1.0, 1.0)


def _smooth(share: float) -> float:
    """Returns a smooth step from 0 to 1 between the arguments 0 and 1."""
    share = min(max(share, 0.0), 1.0)
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
