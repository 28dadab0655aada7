"""Makes a robot follow joint trajectories."""

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import pybullet

from rpbi.control.joint_drive import JointDrive
from rpbi.control.motion import JointMotion
from rpbi.engine.clock import NS_PER_S, Clock, Schedule

from .config import JointTrajectoryControllerConfig
from .joint_trajectory import JointTrajectory, validate_trajectory
from .motion import TrajectoryMotion, stopping
from .request import (
    ErrorCode,
    GoalTolerances,
    Tolerances,
    TrajectoryRefusedError,
    TrajectoryRequest,
    resolved_tolerances,
)
from .trajectory import DesiredState, Knot, Trajectory, TrajectoryStateSample


class CheckedRequest(NamedTuple):
    """A trajectory that passed all checks that do not need the robot's state.

    Attributes:
        joint_trajectories: One trajectory for each joint of the request; empty to stop and hold.
        stamp_ns: Start time, in the world's stamps [ns]; 0 to start at once.
        tolerances: Tolerances; None to check no tolerances.
    """

    joint_trajectories: tuple[JointTrajectory, ...]
    stamp_ns: int
    tolerances: Tolerances | None


class TrajectoryFollower:
    """Makes a robot follow trajectories. From its start time on, a new trajectory replaces the present trajectory.

    Attributes:
        joint_names: Names of the joints that the follower drives.
    """

    def __init__(self, drive: JointDrive, config: JointTrajectoryControllerConfig) -> None:
        self.config = config
        self._drive, self._stop_s = drive, config.stop_trajectory_duration
        driven = {joint.name: joint for joint in drive.model.driven}
        self._joints = driven if config.joints is None else {name: driven[name] for name in config.joints}
        self._by_index = {joint.index: joint for joint in self._joints.values()}
        self.joint_names = tuple(self._joints)

    def check(self, request: TrajectoryRequest, tolerances: GoalTolerances | None = None) -> CheckedRequest:
        """Checks a trajectory as far as possible without the robot's state. Any thread may call this method.

        Args:
            request: The trajectory.
            tolerances: Tolerances for `follow`; None to follow without tolerances.

        Raises:
            TrajectoryRefusedError: If the trajectory or a tolerance is invalid.
        """
        joint_trajectories = validate_trajectory(request, self._joints, self.config.allow_partial_joints_goal)
        resolved = None
        if tolerances is not None:
            resolved = resolved_tolerances(tolerances, self.config.constraints, self._joints)
        return CheckedRequest(joint_trajectories, request.stamp_ns, resolved)

    def follow(
        self, request: CheckedRequest, clock: Clock, feedback: Callable[[TrajectoryStateSample], None] | None = None
    ) -> TrajectoryMotion:
        """Starts a motion that follows a trajectory, and returns the motion. The present motion is preempted.

        Until the start time, all joints continue their present trajectories. Joints that the request leaves out follow
        their present trajectories to the end.

        Args:
            request: Result of `check`.
            clock: The world's clock.
            feedback: Function that is called with the follower's state at `action_monitor_rate` while the motion lasts.

        Raises:
            TrajectoryRefusedError: If all points are in the past, the motion to the trajectory's next point would
                exceed a joint's limits, the control mode is torque control, or a controller drives a joint.
        """
        now_s = clock.time_s
        start_s = now_s + (request.stamp_ns - clock.stamp_ns) / NS_PER_S if request.stamp_ns else now_s
        from_s = max(now_s, start_s)
        _check_time(request, start_s, from_s)
        running = self._running
        trajectories = {} if running is None else {i: each.since(now_s) for i, each in running.trajectories.items()}
        measured = self._drive.measured()
        for joint_trajectory in request.joint_trajectories:
            index = joint_trajectory.joint.index
            current = trajectories.get(index) or Trajectory.through([Knot(now_s, measured[index][:1])])
            trajectories[index] = joint_trajectory.spliced_onto(current, start_s, from_s)
        if not request.joint_trajectories:
            trajectories, from_s = self._stopping(now_s, measured, trajectories or self._by_index), now_s
        motion = TrajectoryMotion(self._by_index, trajectories, from_s, request.tolerances, self._stop_s)
        if feedback is not None:
            motion.on_advance = self._feeding(feedback, clock)
        self._run(motion, "a newer trajectory replaced it")
        return motion

    def cancel(self, reason: str, clock: Clock, motion: TrajectoryMotion | None = None) -> None:
        """Replaces the present motion by one in which the joints stop within `stop_trajectory_duration` and hold.

        Args:
            reason: Why the motion is replaced; becomes the message in the replaced motion's result.
            clock: The world's clock.
            motion: Motion that must be the present one; if it is not, the call has no effect. None stops whatever
                motion is present.
        """
        running = self._running
        if running is None or motion not in (None, running):
            return
        trajectories = self._stopping(clock.time_s, self._drive.measured(), running.joints)
        self._run(TrajectoryMotion(self._by_index, trajectories, clock.time_s), reason)

    def state(self, time_s: float, measured: JointMotion | None = None) -> TrajectoryStateSample:
        """Returns the follower's desired and measured joint states.

        Args:
            time_s: The world's present time [s].
            measured: Measured state of all driven joints; None to measure now.
        """
        running, measured = self._running, measured or self._drive.measured()
        return TrajectoryStateSample(
            self._drive.name,
            self.joint_names,
            self.desired(time_s),
            tuple(measured[index][0] for index in self._by_index),
            tuple(measured[index][1] for index in self._by_index),
            0.0 if running is None else max(0.0, time_s - running.from_s),
        )

    def desired(self, time_s: float) -> DesiredState:
        """Returns the desired state of the follower's joints at a given time of the world's clock [s].

        The desired position of a joint without a trajectory is the motor's target under position control, and the
        measured position in other modes.
        """
        running = self._running
        trajectories = {} if running is None else running.trajectories
        held: Mapping[int, float] = self._drive.motors.targets
        if self._drive.motors.mode != pybullet.POSITION_CONTROL:
            held = {index: position for index, (position, _) in self._drive.measured().items()}
        states = [
            trajectories[index].sample(time_s)
            if index in trajectories
            else DesiredState((held[index],), (0.0,), (0.0,))
            for index in self._by_index
        ]
        return DesiredState(*(tuple(state[kind][0] for state in states) for kind in range(len(DesiredState._fields))))

    @property
    def _running(self) -> TrajectoryMotion | None:
        motion = self._drive.motion
        return motion if isinstance(motion, TrajectoryMotion) else None

    def _feeding(
        self, feedback: Callable[[TrajectoryStateSample], None], clock: Clock
    ) -> Callable[[float, JointMotion], None]:
        schedule = Schedule(self.config.action_monitor_rate, clock.dt_ns)

        def on_advance(time_s: float, measured: JointMotion) -> None:
            if schedule.is_due(round(time_s / clock.dt_s)):
                feedback(self.state(time_s, measured))

        return on_advance

    def _stopping(self, now_s: float, measured: JointMotion, indices: Iterable[int]) -> dict[int, Trajectory]:
        return {index: stopping(self._by_index[index], measured[index], now_s, self._stop_s) for index in indices}

    def _run(self, motion: TrajectoryMotion, reason: str) -> None:
        """Starts a motion, and ends the present trajectory motion with `reason` as the message of its result.

        Raises:
            TrajectoryRefusedError: If the control mode is torque control, or a controller drives a joint.
        """
        running = self._running
        if running is not None:
            running.preempt(reason)
        try:
            self._drive.run(motion)
        except ValueError as error:
            raise TrajectoryRefusedError(str(error)) from None


def _check_time(request: CheckedRequest, start_s: float, from_s: float) -> None:
    if not request.joint_trajectories:
        return
    last_s = request.joint_trajectories[0].knots[-1].time_s
    if start_s + last_s > from_s:
        return
    if request.stamp_ns:
        message = f"all points are in the past, the last one by {from_s - start_s - last_s:.6g} s"
        raise TrajectoryRefusedError(message, ErrorCode.OLD_HEADER_TIMESTAMP)
    raise TrajectoryRefusedError(f"expected a point after the start, the last one is at {last_s:g} s")
