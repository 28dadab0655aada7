"""Reference motions for the examples: a figure eight, circles, an orbit, a route, joint swings, a wave, and a grasp."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from pydantic import Field

from custom_ros_tools.node_configs import StartParameters
from custom_ros_tools.schema import Hz, NonNegative, Seconds
from custom_ros_tools.transforms import Array, quat_of
from robot_model.geometry import Quaternion, Vector
from rpbi.control.trajectories.trajectory import minimum_jerk

CIRCLE_RADIUS = 0.12
"""Radius of the hands' circles [m]."""
CIRCLE_PERIOD_S = 6.0
"""Time for one turn of a circle [s]."""
CIRCLE_CENTRE = (0.55, 0.30, 0.85)
"""Lowest point of the left hand's circle in the world [m]. The right hand's circle has the opposite y."""
WIPED_M = 0.3
"""Length of the line along which a hand wipes [m]."""
WIPING_PERIOD_S = 4.0
"""Time for wiping the line forth and back [s]."""
POINTING_DOWN = (0.0, 1.0, 0.0, 0.0)
"""Orientation of the hands as quaternion x, y, z, w. The hands' z axis points down."""
ORBIT_RADIUS = 2.0
"""Distance of the camera from the vertical axis of its orbit [m]."""
ORBIT_HEIGHT = 1.5
"""Height of the camera above the ground [m]."""
TARGET_HEIGHT = 0.4
"""Height of the point on the orbit's axis at which the camera points [m]."""
ORBIT_SPEED = math.pi / 8.0
"""Angular speed of the camera on its orbit [rad/s]."""
ROUTE_GAIN = 1.5
"""Speed towards the next waypoint, divided by the remaining distance or angle [1/s]."""
REACHED_M = 0.03
"""Distance from a waypoint at which the waypoint counts as reached [m]."""
REACHED_RAD = 0.03
"""Angle from a waypoint at which the waypoint counts as reached [rad]."""
TO_MIDDLE_S = 3.0
"""Time in which all joints move from the start to the middle of their swings [s]."""
SWING_PERIOD_S = 4.0
"""Duration of one joint's swing [s]. The joints swing one after the other."""
SWING_RAMP_S = 0.6
"""Time for the acceleration at the start of a swing, and for the deceleration at its end [s]."""
SWING_AMPLITUDE = 1.0
"""Amplitude of a swing [rad or m]. The joint limits may reduce it."""
SWING_MARGIN = 0.95
"""Share of the distance to a joint limit that a swing may use."""
RAISED_DEG = {"jRightShoulder_rotx": -10.0, "jRightShoulder_roty": -60.0, "jRightElbow_rotz": 75.0}
"""Joint angles [deg] with which a human model raises its right hand."""
RAISE_S = 2.0
"""Time to raise the hand [s]."""
WAVE_JOINT, WAVE_AMPLITUDE, WAVE_PERIOD_S = "jRightElbow_rotz", math.radians(30.0), 1.5
"""Joint that waves, its amplitude [rad], and the duration of one wave [s]."""
FINGERS_OPEN, FINGERS_CLOSED = 0.04, 0.0
"""Target positions of an open and of a closed finger [m]. A grasped box stops the finger before it is closed."""
GRASP_HEIGHT, CARRY_HEIGHT = 0.025, 0.2
"""Height of the point between the fingertips [m] during grasp and release, and while the box is carried."""


class FigureEight(StartParameters):
    """A lemniscate of Gerono in the x-y plane of its frame."""

    start_on_init: bool = Field(True, description="Whether the frame moves from the start.")
    hz: Hz = Field(50.0, description="Rate at which the frame is broadcast.")
    tf_ns: str = Field("", description="Prefix of the frame names, such as rpbi.")
    width: NonNegative = Field(0.4, description="Size of the figure along y [m].")
    height: NonNegative = Field(0.2, description="Size of each loop along x [m].")
    period_s: Seconds = Field(10.0, description="Duration of one round.")

    def position(self, time_s: float) -> Vector:
        """Returns the position on the figure at a time [s], in the figure's frame [m]."""
        angle = 2.0 * math.pi * time_s / self.period_s
        return self.height * math.sin(angle) * math.cos(angle), self.width / 2.0 * math.sin(angle), 0.0

    def frame(self, name: str) -> str:
        """Returns a frame's name with the configured prefix `tf_ns`."""
        return "/".join(part for part in (self.tf_ns.strip("/"), name) if part)


def hand_position(time_s: float, side: float, distance: float = 2.0 * CIRCLE_CENTRE[1]) -> Vector:
    """Returns the target position of a hand on its circle, in the world [m].

    Args:
        time_s: Time since the start [s].
        side: 1 for the left hand, -1 for the right hand.
        distance: Distance between the centres of both circles [m].
    """
    angle = 2.0 * math.pi * time_s / CIRCLE_PERIOD_S
    x, _, z = CIRCLE_CENTRE
    return x, side * (distance / 2.0 + CIRCLE_RADIUS * math.sin(angle)), z + CIRCLE_RADIUS * (1.0 - math.cos(angle))


def wiped(time_s: float) -> float:
    """Returns the signed distance of a wiping hand from the middle of its line [m] at a time since the start [s]."""
    return WIPED_M / 2.0 * math.sin(2.0 * math.pi * time_s / WIPING_PERIOD_S)


def camera_pose(time_s: float) -> tuple[Vector, Array]:
    """Returns the pose of an orbiting camera's optical frame in the world at a time [s].

    The optical frame has x to the right, y down and z forward.

    Returns:
        Position [m], and orientation as quaternion x, y, z, w.
    """
    angle = ORBIT_SPEED * time_s
    position = ORBIT_RADIUS * math.cos(angle), ORBIT_RADIUS * math.sin(angle), ORBIT_HEIGHT
    yaw = angle + math.pi / 2.0  # the camera's right is its direction of motion along the circle
    tilt = -math.pi / 2.0 - math.atan2(ORBIT_HEIGHT - TARGET_HEIGHT, ORBIT_RADIUS)
    # first about x by `tilt`, so that z points forward and down, then about the vertical by `yaw`
    return position, quat_of((tilt, 0.0, yaw))


class PlanarPose(NamedTuple):
    """Pose on the floor: x and y [m], and the angle about the vertical [rad]."""

    x: float
    y: float
    yaw: float


SQUARE = tuple(
    PlanarPose(0.8 * x, 0.8 * y, math.pi / 2.0 * turns)
    for x, y, turns in ((-1, -1, 0), (1, -1, 0), (1, 1, 1), (-1, 1, 1), (-1, 1, 2), (-1, -1, 3))
)
"""Waypoints around a square. A base drives forwards along the first side, turns along the second, drives sideways along
the third, and turns along the last.
"""


class Route:
    """A closed route along waypoints. After the last waypoint, the route continues with the first."""

    def __init__(self, waypoints: Sequence[PlanarPose] = SQUARE) -> None:
        self._waypoints = tuple(waypoints)
        self._next = 0

    def velocity(self, pose: PlanarPose) -> PlanarPose:
        """Returns the velocity with which a base at a pose moves to the next waypoint.

        Args:
            pose: Present pose of the base.

        Returns:
            Velocity in the base's frame [m/s, m/s, rad/s].
        """
        distance, angle = _left(pose, self._waypoints[self._next])
        if math.hypot(*distance) < REACHED_M and abs(angle) < REACHED_RAD:
            self._next = (self._next + 1) % len(self._waypoints)
            distance, angle = _left(pose, self._waypoints[self._next])
        cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
        ahead, aside = cos * distance[0] + sin * distance[1], cos * distance[1] - sin * distance[0]
        return PlanarPose(ROUTE_GAIN * ahead, ROUTE_GAIN * aside, ROUTE_GAIN * angle)


def _left(pose: PlanarPose, goal: PlanarPose) -> tuple[tuple[float, float], float]:
    """Returns the vector x, y [m] from a pose to a goal, and the rotation of at most half a turn [rad]."""
    return (goal.x - pose.x, goal.y - pose.y), math.remainder(goal.yaw - pose.yaw, 2.0 * math.pi)


class GraspStep(NamedTuple):
    """Target of a hand with two fingers.

    Attributes:
        place: x, y and yaw of the point between the fingertips.
        height: Height of the point between the fingertips above the floor [m].
        finger: Position of each finger [m].
    """

    place: PlanarPose
    height: float
    finger: float

    @property
    def position(self) -> Vector:
        """Position of the point between the fingertips in the world [m]."""
        return self.place.x, self.place.y, self.height

    @property
    def quat_xyzw(self) -> Quaternion:
        """Orientation of the hand. The hand points down, and the fingers close along the y axis of `place`."""
        return math.cos(self.place.yaw / 2.0), math.sin(self.place.yaw / 2.0), 0.0, 0.0


def pick_and_place(box: PlanarPose, goal: PlanarPose) -> tuple[GraspStep, ...]:
    """Returns the steps with which a hand carries a box to a goal. Each step moves either the hand or the fingers.

    Args:
        box: Pose of the box's centre. Yaw angles that differ by multiples of 90 deg are equivalent.
        goal: Goal pose of the box's centre.
    """
    box = box._replace(yaw=math.remainder(box.yaw, math.pi / 2.0))
    return (
        GraspStep(box, CARRY_HEIGHT, FINGERS_OPEN),
        GraspStep(box, GRASP_HEIGHT, FINGERS_OPEN),
        GraspStep(box, GRASP_HEIGHT, FINGERS_CLOSED),
        GraspStep(box, CARRY_HEIGHT, FINGERS_CLOSED),
        GraspStep(goal, CARRY_HEIGHT, FINGERS_CLOSED),
        GraspStep(goal, GRASP_HEIGHT, FINGERS_CLOSED),
        GraspStep(goal, GRASP_HEIGHT, FINGERS_OPEN),
        GraspStep(goal, CARRY_HEIGHT, FINGERS_OPEN),
    )


class Swing:
    """Motion in which n joints swing one after the other.

    Args:
        start: Positions of the n joints at time 0 [rad or m].
        lower: Lower limits of the joints [rad or m]; -inf without a limit.
        upper: Upper limits of the joints [rad or m]; inf without a limit.
        middle: Centres of the swings [rad or m], which are clipped to the limits. Default: 0.
        amplitude: Amplitude of the swings [rad or m]. The limits may reduce the amplitude.
    """

    def __init__(
        self,
        start: Sequence[float],
        lower: Sequence[float],
        upper: Sequence[float],
        middle: Sequence[float] | None = None,
        amplitude: float = SWING_AMPLITUDE,
    ) -> None:
        wanted = (0.0,) * len(start) if middle is None else middle
        self._middle = tuple(min(max(at, low), high) for at, low, high in zip(wanted, lower, upper, strict=True))
        self._to_middle = minimum_jerk(start, self._middle, 0.0, TO_MIDDLE_S)
        self._amplitude = tuple(
            max(0.0, min(amplitude, SWING_MARGIN * (high - at), SWING_MARGIN * (at - low)))
            for at, low, high in zip(self._middle, lower, upper, strict=True)
        )
        forth = list(range(len(start)))
        self._order = forth + forth[-2:0:-1]

    def at(self, time_s: float) -> tuple[float, ...]:
        """Returns the positions of the n joints at a time since the start [s]."""
        if time_s < TO_MIDDLE_S:
            return self._to_middle.sample(time_s).position
        turn, phase_s = divmod(time_s - TO_MIDDLE_S, SWING_PERIOD_S)
        joint = self._order[int(turn) % len(self._order)]
        positions = list(self._middle)
        positions[joint] += self._amplitude[joint] * math.sin(_swing_angle(phase_s))
        return tuple(positions)


class Wave:
    """Motion in which a human model raises its right hand and waves.

    Args:
        names: Names of the model's n joints.
        start: Positions of the joints at time 0 [rad].
    """

    def __init__(self, names: Sequence[str], start: Sequence[float]) -> None:
        self._joint = names.index(WAVE_JOINT)
        raised = {name: math.radians(angle_deg) for name, angle_deg in RAISED_DEG.items()}
        goal = [raised.get(name, at) for name, at in zip(names, start, strict=True)]
        self._raising = minimum_jerk(start, goal, 0.0, RAISE_S)

    def at(self, time_s: float) -> tuple[float, ...]:
        """Returns the positions of the n joints at a time since the start [s]."""
        positions = list(self._raising.sample(min(time_s, RAISE_S)).position)
        waved_s = max(time_s - RAISE_S, 0.0)
        growth = min(waved_s / WAVE_PERIOD_S, 1.0)
        positions[self._joint] += growth * WAVE_AMPLITUDE * math.sin(2.0 * math.pi * waved_s / WAVE_PERIOD_S)
        return tuple(positions)


def _swing_angle(phase_s: float) -> float:
    """Returns the phase angle of a swing [rad] at a time since its start [s].

    The angle grows from 0 to 2 pi. Its rate is 0 at the start and at the end.
    """
    if phase_s > SWING_PERIOD_S / 2.0:
        return 2.0 * math.pi - _swing_angle(SWING_PERIOD_S - phase_s)
    speed = 2.0 * math.pi / (SWING_PERIOD_S - SWING_RAMP_S)
    if phase_s > SWING_RAMP_S:
        return speed * (phase_s - SWING_RAMP_S / 2.0)
    return speed / 2.0 * (phase_s - SWING_RAMP_S / math.pi * math.sin(math.pi * phase_s / SWING_RAMP_S))
