"""Bodies that follow a stream of poses with a velocity, so that contact forces are correct."""

from __future__ import annotations

import logging
import math
from collections import deque

import numpy as np
import numpy.typing as npt

from robot_model.geometry import Vector, cross, dot, minus, normalized, rotation_between, scaled
from rpbi.config.pybullet_models import ObjectTf
from rpbi.engine.client import Client
from rpbi.geometry import Pose

log = logging.getLogger(__name__)

INTERVALS = 5
"""Number of last intervals between poses whose longest is the stream's period."""
LONGEST_GROWTH = 2
"""Largest growth of the longest interval by a new one; a longer interval is a pause, and clipped to it."""
JUMP_S = 0.1
"""Longest motion to a pose at the largest speeds [s], or two periods if that is longer; a pose further away is a
jump."""
QUIET_S = 5.0
"""Time after a warning of a jump without another [s] of the world's time."""

MAX_TICKS = 10_000
"""Largest number of ticks over which a path is smoothed."""

_Numbers = npt.NDArray[np.float64]


class PosePath:
    """Smooths a stream of poses, tick by tick.

    Straight lines lead to each pose, in the longest of the last few intervals between poses, or longer at the largest
    speeds. The path is the moving average of these lines: the velocity changes evenly, without overshoot. Quaternions
    are averaged as vectors, signs aligned.

    Args:
        start: Pose at the beginning, at rest.
        ticks: Expected interval between poses [ticks], over which the mean is taken.
        max_step: Largest translation in a tick [m].
        max_turn: Largest rotation in a tick [rad].
    """

    def __init__(self, start: Pose, ticks: int, max_step: float, max_turn: float) -> None:
        self._max_step, self._max_turn = max_step, max_turn
        self._intervals = deque([ticks], maxlen=INTERVALS)
        self._taken_at: int | None = None
        self.goal = start
        self._line = _numbers(start)
        self._step = np.zeros(7)
        self._line_ticks = 0
        self._window = deque([self._line] * ticks)
        self._sum = self._line * ticks
        self.ticks_left = 0
        """Ticks until it rests at its goal."""

    @property
    def period(self) -> int:
        """Longest recent interval between poses [ticks]."""
        return max(self._intervals)

    def ticks_to(self, pose: Pose) -> float:
        """Returns the ticks from the end of the line to a pose at the largest speeds."""
        way = _numbers(pose, self._line) - self._line
        turn = 4.0 * math.tan(math.asin(np.linalg.norm(way[3:]) / 2.0))  # at the speed in the middle of the line
        return max(float(np.linalg.norm(way[:3])) / self._max_step, turn / self._max_turn)

    def push(self, pose: Pose, tick: int) -> None:
        """Sets the goal to a pose received before a tick."""
        if self._taken_at is not None:
            self._intervals.append(min(tick - self._taken_at, LONGEST_GROWTH * self.period))
        self._taken_at = tick
        self.goal = pose
        self._line = np.append(self._line[:3], self._line[3:] / np.linalg.norm(self._line[3:]))
        self._line_ticks = max(self.period, math.ceil(self.ticks_to(pose)))
        self._step = (_numbers(pose, self._line) - self._line) / self._line_ticks
        self.ticks_left = self._line_ticks + len(self._window) - 1

    def next(self) -> Pose:
        """Advances by a tick, and returns the pose after it."""
        if self._line_ticks:
            self._line_ticks -= 1
            self._line = self._line + self._step
        self._window.append(self._line)
        self._sum += self._line - self._window.popleft()
        self.ticks_left -= 1
        if self.ticks_left <= 0:
            return self.goal
        x, y, z, *quat = (self._sum / len(self._window)).tolist()
        return Pose((x, y, z), normalized(quat))


def _numbers(pose: Pose, near: _Numbers | None = None) -> _Numbers:
    """Returns position and quaternion, the latter with the sign that is nearer to another one."""
    numbers = np.array([*pose.position, *pose.quat_xyzw])
    if near is not None and numbers[3:] @ near[3:] < 0.0:
        numbers[3:] *= -1.0
    return numbers


class PoseFollower:
    """Moves a fixed base of one PyBullet body along a stream of poses.

    A base without mass moves at its set velocity, and contacts are solved with it: it carries and pushes other bodies,
    with friction, and nothing stops it. Before each tick its velocity is set to reach the path's next pose. The first
    pose, and any beyond a jump, is set at once, at rest.

    Args:
        name: The body, for messages.
        centre: The pose of its centre of mass, which PyBullet moves, in the frame that follows.
    """

    def __init__(self, pb: Client, name: str, body_id: int, centre: Pose, object_tf: ObjectTf) -> None:
        self.name = name
        self._pb, self._body_id, self._centre = pb, body_id, centre
        self._object_tf = object_tf
        self._dt_s: float = pb.getPhysicsEngineParameters()["fixedTimeStep"]
        self._path: PosePath | None = None
        self._waiting: Pose | None = None
        self._is_moving = False
        self._quiet_until = 0
        """Tick from which a jump is logged again."""

    def push(self, pose: Pose) -> None:
        """Sets the goal from the next tick on; the first pose is set at once."""
        if self._path is None:
            self.put(pose)
        else:
            self._waiting = pose @ self._centre

    def put(self, pose: Pose) -> None:
        """Sets the following frame to a pose at once, at rest."""
        self._waiting = None
        self._begin(pose @ self._centre)

    @property
    def is_idle(self) -> bool:
        """Whether no pose has come that the base is to reach or follow."""
        return self._path is None and self._waiting is None

    def before_step(self, tick: int) -> None:
        """Sets the velocity of the base for the coming tick."""
        path = self._path
        if path is None:
            return
        if self._waiting is not None:
            path = self._aim(path, self._waiting, tick)
        if path.ticks_left:
            self._drive_to(path.next())
        elif self._is_moving:
            self._rest_at(path.goal)

    def _aim(self, path: PosePath, pose: Pose, tick: int) -> PosePath:
        """Extends the path to a pose; beyond a jump it restarts there."""
        self._waiting = None
        if path.ticks_to(pose) <= max(JUMP_S / self._dt_s, 2 * path.period):
            path.push(pose, tick)
            return path
        if tick >= self._quiet_until:
            self._quiet_until = tick + round(QUIET_S / self._dt_s)
            way = math.dist(path.goal.position, pose.position)
            turn = math.hypot(*rotation_between(path.goal.quat_xyzw, pose.quat_xyzw))
            jump = f"'{self._object_tf.tf_id}' jumped by {way:.3g} m and {turn:.3g} rad"
            log.warning("%s: TF: %s: it was put there at tick %d, at rest", self.name, jump, tick)
        return self._begin(pose)

    def _begin(self, pose: Pose) -> PosePath:
        self._path = self._path_from(pose)
        self._rest_at(pose)
        return self._path

    def _path_from(self, pose: Pose) -> PosePath:
        tf, dt_s = self._object_tf, self._dt_s
        ticks = min(max(1, round(1.0 / (tf.hz * dt_s))), MAX_TICKS)
        return PosePath(pose, ticks, tf.max_speed * dt_s, tf.max_angular_speed * dt_s)

    def _rest_at(self, pose: Pose) -> None:
        self._pb.resetBasePositionAndOrientation(self._body_id, *pose)  # which takes its velocity too
        self._is_moving = False

    def _drive_to(self, pose: Pose) -> None:
        """Sets the velocity that leads to a pose in a tick."""
        position, quat = self._pb.getBasePositionAndOrientation(self._body_id)
        way, turn = minus(pose.position, position), rotation_between(quat, pose.quat_xyzw)
        # PyBullet moves a rotating base by d + r x d, so the velocity is the inverse of that
        across = cross(turn, way)
        straight = minus(way, scaled(1.0 / (1.0 + dot(turn, turn)), minus(across, cross(turn, across))))
        linear, angular = scaled(1.0 / self._dt_s, straight), scaled(1.0 / self._dt_s, turn)
        self._pb.resetBaseVelocity(self._body_id, self._velocity_before(linear), angular)
        self._is_moving = True

    def _velocity_before(self, velocity: Vector) -> Vector:
        """Returns the velocity [m/s] before the forces of a tick act; no forces act on a base without mass."""
        return velocity


class TrackedBase(PoseFollower):
    """Moves the base of a dynamic body along a stream of poses while they come; in between, physics moves it.

    Before each tick its velocity is set along the path, less the change by gravity in that tick: contacts are solved
    with that velocity and the body's own mass. Without a pose for `timeout_s` of the world's time it moves freely;
    later poses lead on from its present pose.
    """

    def __init__(self, pb: Client, name: str, body_id: int, centre: Pose, object_tf: ObjectTf) -> None:
        super().__init__(pb, name, body_id, centre, object_tf)
        self._is_known = False
        self._taken_at = 0
        """Tick before which the last pose came."""
        self._timeout_ticks = math.ceil(object_tf.timeout_s / self._dt_s)

    def push(self, pose: Pose) -> None:
        """Sets the goal from the next tick on; the first pose is set at once."""
        self._waiting = pose @ self._centre

    def put(self, pose: Pose) -> None:
        """Leaves the body to physics until the next pose comes, after it was set to a pose."""
        self._path = self._waiting = None

    def before_step(self, tick: int) -> None:
        """Sets the velocity of the base for the coming tick, if it is tracked."""
        if self._waiting is not None:
            self._taken_at = tick
            if self._path is None:
                known = Pose(*self._pb.getBasePositionAndOrientation(self._body_id))
                self._path = self._path_from(known) if self._is_known else self._begin(self._waiting)
                self._is_known = True
            self._path = self._aim(self._path, self._waiting, tick)
        elif tick - self._taken_at >= self._timeout_ticks:
            self._path = None
        if self._path is not None:
            self._drive_to(self._path.next() if self._path.ticks_left else self._path.goal)

    def _velocity_before(self, velocity: Vector) -> Vector:
        return minus(velocity, scaled(self._dt_s, self._pb.gravity))
