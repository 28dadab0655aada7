"""Moves bodies along a stream of poses by setting velocities, so that contact forces are correct."""

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
"""Number of recent intervals between poses; the longest of these is the stream's period."""
LONGEST_GROWTH = 2
"""Largest ratio of a new interval to the period. A longer interval is a pause, and is clipped."""
JUMP_S = 0.1
"""Distance beyond which a new pose counts as a jump, as travel time at the largest speeds [s].

If two periods of the stream are longer, two periods count instead.
"""
QUIET_S = 5.0
"""Shortest interval [s], in the world's time, between two warnings about jumps."""

MAX_TICKS = 10_000
"""Largest length [ticks] of the moving average."""

_Numbers = npt.NDArray[np.float64]


class PosePath:
    """Interpolates a stream of poses smoothly, tick by tick.

    A straight line leads to each new pose. The line lasts for one period of the stream, or longer if the speed limits
    require more time. The path is the moving average of these lines, so that velocity changes evenly and never
    overshoots. Quaternions are averaged as vectors with aligned signs.

    Args:
        start: Initial pose, at rest.
        ticks: Expected interval between poses, and length of the moving average [ticks].
        max_step: Maximum translation per tick [m].
        max_turn: Maximum rotation per tick [rad].

    Attributes:
        goal: The newest pose.
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
        """Number of ticks until the path ends at its goal."""

    @property
    def period(self) -> int:
        """Longest recent interval [ticks] between poses."""
        return max(self._intervals)

    def ticks_to(self, pose: Pose) -> float:
        """Returns the time [ticks] to travel from the line's present point to a pose at the maximum speeds."""
        way = _numbers(pose, self._line) - self._line
        turn = 4.0 * math.tan(math.asin(np.linalg.norm(way[3:]) / 2.0))  # rotation is fastest in the middle of the line
        return max(float(np.linalg.norm(way[:3])) / self._max_step, turn / self._max_turn)

    def push(self, pose: Pose, tick: int) -> None:
        """Sets a new goal.

        Args:
            pose: The goal.
            tick: Number of the first tick after the pose was received.
        """
        if self._taken_at is not None:
            self._intervals.append(min(tick - self._taken_at, LONGEST_GROWTH * self.period))
        self._taken_at = tick
        self.goal = pose
        self._line = np.append(self._line[:3], self._line[3:] / np.linalg.norm(self._line[3:]))
        self._line_ticks = max(self.period, math.ceil(self.ticks_to(pose)))
        self._step = (_numbers(pose, self._line) - self._line) / self._line_ticks
        self.ticks_left = self._line_ticks + len(self._window) - 1

    def next(self) -> Pose:
        """Advances the path by one tick, and returns the pose at the end of the tick."""
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
    """Returns position and quaternion of a pose as 7 numbers, with the quaternion's sign chosen to be near `near`."""
    numbers = np.array([*pose.position, *pose.quat_xyzw])
    if near is not None and numbers[3:] @ near[3:] < 0.0:
        numbers[3:] *= -1.0
    return numbers


class PoseFollower:
    """Moves the fixed base of one PyBullet body along a stream of poses.

    Before each tick, the velocity of the base is set such that the base reaches the next pose of the path. PyBullet
    moves a base without mass at exactly this velocity, and uses the velocity for contacts. The base therefore carries
    and pushes other bodies, and no contact stops the base. If a pose is the first or too far away for a path (a jump),
    the base is set to the pose directly.

    Args:
        name: Name of the body, for messages.
        body_id: PyBullet's id of the body.
        centre: Pose of the base's inertial frame, which PyBullet moves, in the frame that follows the poses.
        object_tf: Configuration of the stream: frame name, rate and maximum speeds.
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
        """Tick from which the next jump is logged."""

    def push(self, pose: Pose) -> None:
        """Sets a new goal, which acts from the next tick on. For the first pose, moves the base to the pose at once."""
        if self._path is None:
            self.put(pose)
        else:
            self._waiting = pose @ self._centre

    def put(self, pose: Pose) -> None:
        """Moves the base in one step so that the frame that follows the poses is at `pose`; sets the velocity to 0."""
        self._waiting = None
        self._begin(pose @ self._centre)

    @property
    def is_idle(self) -> bool:
        """Whether the body has neither a path to follow nor a new pose."""
        return self._path is None and self._waiting is None

    def before_step(self, tick: int) -> None:
        """Sets the velocity of the base for the next tick."""
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
        """Extends the path to a pose. If the pose is a jump, sets the base to the pose and starts a new path."""
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
        self._pb.resetBasePositionAndOrientation(self._body_id, *pose)  # also sets the velocity to 0
        self._is_moving = False

    def _drive_to(self, pose: Pose) -> None:
        """Sets the velocity with which the base reaches a pose within one tick."""
        position, quat = self._pb.getBasePositionAndOrientation(self._body_id)
        way, turn = minus(pose.position, position), rotation_between(quat, pose.quat_xyzw)
        # PyBullet moves a rotating base by d + r x d, where d and r are translation and rotation; this is the inverse.
        across = cross(turn, way)
        straight = minus(way, scaled(1.0 / (1.0 + dot(turn, turn)), minus(across, cross(turn, across))))
        linear, angular = scaled(1.0 / self._dt_s, straight), scaled(1.0 / self._dt_s, turn)
        self._pb.resetBaseVelocity(self._body_id, self._velocity_before(linear), angular)
        self._is_moving = True

    def _velocity_before(self, velocity: Vector) -> Vector:
        """Returns the velocity [m/s] to set so that the base has `velocity` after the forces of the tick.

        Forces do not change the velocity of a base without mass, so the result equals `velocity`.
        """
        return velocity


class TrackedBase(PoseFollower):
    """Moves the base of a dynamic body along a stream of poses; without poses, physics moves the body.

    Before each tick, the velocity of the base is set along the path, with gravity's effect in the tick subtracted.
    Contacts are solved with the body's own mass. If no pose comes for `timeout_s` of the world's
    time, the body moves freely. The next pose then starts a path from the body's present pose.
    """

    def __init__(self, pb: Client, name: str, body_id: int, centre: Pose, object_tf: ObjectTf) -> None:
        super().__init__(pb, name, body_id, centre, object_tf)
        self._is_known = False
        self._taken_at = 0
        """Tick before which the newest pose came."""
        self._timeout_ticks = math.ceil(object_tf.timeout_s / self._dt_s)

    def push(self, pose: Pose) -> None:
        """Sets a new goal for the next tick. In that tick, the base jumps to the goal if the goal is the first one."""
        self._waiting = pose @ self._centre

    def put(self, pose: Pose) -> None:
        """Drops path and goal after other code has set the body's pose; physics moves the body until a pose comes."""
        self._path = self._waiting = None

    def before_step(self, tick: int) -> None:
        """Sets the velocity of the base for the next tick, unless physics moves the body."""
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
