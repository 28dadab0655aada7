"""Passes the poses of TF frames to the world, and logs problems at a limited rate."""

import contextlib
import math
import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
import tf2_ros

from custom_ros_tools.errors import InterfaceError, PluginError
from custom_ros_tools.plugins import cause_of, full_name
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from custom_ros_tools.ros.tf_interface import TfListener
from rpbi.engine.inputs import Input, PoseInput
from rpbi.geometry import Pose
from rpbi.plugins import is_foreign

from .headers import named_frame, world_frame

TF_MISSING_AFTER_S = 5.0
"""Longest wait [s], in wall time, for the first transform of a frame; beyond it, a warning is logged."""
LONGEST_NAP_S = 0.1
"""Longest sleep [s] of the thread, in wall time, so that it soon follows frames that were added."""
LOOK_FROM, LOOK_UNTIL = 0.75, 1.5
"""Shares of the period that decide when a frame is looked up, see `FollowedFrame.due_s`."""
STALE_AGAIN_AFTER_S = 30.0
"""Shortest wall time [s] between two warnings that the same frame is stale."""


class WatchedTf:
    """Listens to TF, and records the arrival times of transforms of selected frames.

    Attributes:
        watched: The child frames whose arrival times are recorded.
        came_s: Last arrival time [s] of a transform, as a time of the monotonic clock, indexed by child frame.
        something_came: Event that is set whenever a transform of a watched frame arrives.
    """

    def __init__(self) -> None:
        self.watched: frozenset[str] = frozenset()
        self.came_s: dict[str, float] = {}
        self.something_came = threading.Event()
        self._buffer = tf2_ros.Buffer()
        self._listener = TfListener(self._buffer, self._note)

    def pose(self, parent: str, child: str) -> tuple[Pose, int] | None:
        """Returns the newest pose of frame `child` in frame `parent`, and its stamp [ns]; None if TF has no such pose.

        The stamp is 0 if all transforms between the two frames are static.
        """
        try:
            found = self._buffer.lookup_transform(parent, child, rospy.Time(0))
        except tf2_ros.TransformException:
            return None
        position, quat = found.transform.translation, found.transform.rotation
        pose = Pose((position.x, position.y, position.z), (quat.x, quat.y, quat.z, quat.w))
        return pose, found.header.stamp.to_nsec()

    def _note(self, child: str) -> None:
        if child in self.watched:
            self.came_s[child] = time.monotonic()
            self.something_came.set()


def refusal(slot: str, taken: Input, error: Exception) -> Exception:
    """Returns the error to report after an input has refused a value.

    An InterfaceError or ValueError is returned as it is. Other errors in code of another package are returned as a
    PluginError.

    Raises:
        Exception: `error` itself, if it is a bug of this package.
    """
    if isinstance(error, (InterfaceError, ValueError)):
        return error
    if is_foreign(taken.apply):
        return PluginError(full_name(taken.apply), f"applying '{slot}'", cause_of(error))
    raise error


class FollowedFrame:
    """A pose input, and the state of the TF frame that it follows.

    The frame is looked up about once in each period `1 / pose_input.hz`, at the arrival of a transform. Look-ups at
    other times would make the steps of a motion uneven. A frame that only moves with its parent, so that its own
    transforms do not arrive, is looked up once in each period.
    """

    def __init__(self, name: str, slot: str, pose_input: PoseInput) -> None:
        self.name, self.slot, self.pose_input = name, slot, pose_input
        self.tf_id = named_frame(pose_input.tf_id)
        self.period_s = 1.0 / pose_input.hz
        self.since_s = time.monotonic()
        self.looked_s = self.news_s = -math.inf
        self.last_pose: Pose | None = None
        self.last_stamp_ns = -1
        self.news_time_s = 0.0
        """The world's time [s] at which the frame's stamp last changed; `news_s` is the same moment in wall time."""
        self.is_stale = False
        self.quiet_until_s = 0.0

    def due_s(self, came_s: float) -> float:
        """Returns the time [s] of the next look-up of the frame's pose, on the monotonic clock.

        A period is `1 / pose_input.hz`. The look-up is due:

        - one period after the last look-up, if no transform of the frame has arrived since the last look-up;
        - LOOK_UNTIL periods after the last look-up, if the transform arrived less than LOOK_FROM periods after the
          last look-up that found a new stamp;
        - at the transform's arrival, if the transform arrived at least LOOK_FROM periods after such a look-up.

        Args:
            came_s: Time [s] at which the frame's last transform arrived, on the monotonic clock.
        """
        if came_s <= self.looked_s:
            return self.looked_s + self.period_s
        is_early = came_s < self.news_s + LOOK_FROM * self.period_s
        return self.looked_s + LOOK_UNTIL * self.period_s if is_early else came_s

    def is_new(self, stamp_ns: int, now_s: float, time_s: float) -> bool:
        """Stores the stamp [ns] of the frame's newest pose, and returns whether the stamp has changed.

        `now_s` is the present time [s] of the monotonic clock, `time_s` the present time [s] of the world.
        """
        self.news_time_s = min(self.news_time_s, time_s)  # the world was reset
        if stamp_ns == self.last_stamp_ns:
            return False
        self.last_stamp_ns, self.news_s, self.news_time_s = stamp_ns, now_s, time_s
        return True

    def age_s(self, now_s: float, time_s: float) -> float:
        """Returns the time [s] since the frame's stamp last changed: in wall time or world time, whichever is less."""
        return min(now_s - self.news_s, time_s - self.news_time_s)


class TfFollower:
    """Looks up the TF frames that bodies and sensors follow, and passes their poses to the world.

    One thread does all look-ups, timed by the wall clock. The thread and the subscription to TF start with the first
    followed frame.

    Args:
        put: Passes a pose to the world; its arguments are a slot `NAME/INPUT` and the pose.
        time_s: Returns the world's time [s], for the age of transforms.
    """

    def __init__(self, put: Callable[[str, Any], None], time_s: Callable[[], float]) -> None:
        self._put, self._time_s = put, time_s
        self._followed: tuple[FollowedFrame, ...] = ()
        self._tf: WatchedTf | None = None
        self._warn = ThrottledWarning(period_s=30.0)

    def follow(self, name: str, slot: str, pose_input: PoseInput) -> None:
        """Starts to follow the TF frame of a pose input.

        `name` is the name of the body or sensor, `slot` the address of the input as `NAME/INPUT`.
        """
        self._followed = (*self._followed, FollowedFrame(name, slot, pose_input))
        if self._tf is None:
            self._tf = WatchedTf()
            threading.Thread(target=self._run, args=(self._tf,), name="tf follower", daemon=True).start()

    def leave(self, name: str) -> None:
        """Stops following the frames of a body or sensor."""
        self._followed = tuple(followed for followed in self._followed if followed.name != name)

    def repeat(self) -> None:
        """Passes the last pose of every followed frame to the world again."""
        for followed in self._followed:
            if followed.last_pose is not None:
                with contextlib.suppress(Exception):  # the body was removed, or the pose is refused as before
                    self._put(followed.slot, followed.last_pose)

    def _run(self, tf: WatchedTf) -> None:
        while not rospy.is_shutdown():
            followed = self._followed
            tf.watched = frozenset(each.tf_id for each in followed)
            tf.something_came.clear()
            now_s = next_s = time.monotonic()
            next_s += LONGEST_NAP_S
            for each in followed:
                due_s = each.due_s(tf.came_s.get(each.tf_id, -math.inf))
                if now_s >= due_s:
                    each.looked_s = now_s
                    self._look(tf, each, now_s)
                    due_s = now_s + each.period_s
                next_s = min(next_s, due_s)
            tf.something_came.wait(max(next_s - time.monotonic(), 0.001))

    def _look(self, tf: WatchedTf, followed: FollowedFrame, now_s: float) -> None:
        found = tf.pose(world_frame(), followed.tf_id)
        if found is None:
            if followed.last_pose is None and now_s - followed.since_s > TF_MISSING_AFTER_S:
                self._warn(
                    followed.slot, f"no TF from '{world_frame()}' to '{followed.tf_id}' so far; it stays where it is"
                )
            return
        pose, stamp_ns = found
        is_seen_again = followed.pose_input.is_tracked and stamp_ns != followed.last_stamp_ns
        self._report_stale(followed, stamp_ns, now_s)
        if is_seen_again or pose != followed.last_pose:
            followed.last_pose = pose
            try:
                self._put(followed.slot, pose)
            except Exception as error:
                reason = refusal(followed.slot, followed.pose_input, error)
                if followed in self._followed:  # otherwise the body was removed
                    self._warn(followed.slot, f"TF refused: {reason}")

    def _report_stale(self, followed: FollowedFrame, stamp_ns: int, now_s: float) -> None:
        """Logs a warning if a frame has become stale, or an info message if a stale frame has a new stamp again.

        Static frames are never stale.
        """
        time_s = self._time_s()
        if followed.is_new(stamp_ns, now_s, time_s):
            if followed.is_stale:
                followed.is_stale = False
                rospy.loginfo("%s: TF of '%s' comes again", followed.slot, followed.tf_id)
            return
        age_s = followed.age_s(now_s, time_s)
        if stamp_ns and not followed.is_stale and age_s > followed.pose_input.timeout_s:
            if now_s >= followed.quiet_until_s:
                followed.is_stale, followed.quiet_until_s = True, now_s + STALE_AGAIN_AFTER_S
                stale = f"TF of '{followed.tf_id}' is stale"
                then = "physics moves it" if followed.pose_input.is_tracked else "it stays there"
                rospy.logwarn("%s: %s: nothing new for %.2g s; %s", followed.slot, stale, age_s, then)
