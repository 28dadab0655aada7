"""A motion that follows joint trajectories tick by tick."""

from collections.abc import Callable, Mapping

from rpbi.control.motion import JointMotion, Motion
from rpbi.urdf.joints import Joint

from .request import ErrorCode, JointTolerance, Tolerances
from .trajectory import DesiredState, Knot, Trajectory


class TrajectoryMotion(Motion):
    """Makes joints follow one trajectory each.

    With tolerances, the motion succeeds when all joints are at their goals. If a joint exceeds a tolerance, the motion
    fails and the joints stop. Without tolerances, the motion succeeds when the trajectories end.

    Args:
        joints: The follower's joints, keyed by joint index.
        trajectories: One trajectory per joint in the world's time, keyed by joint index.
        from_s: The world's time [s] from which path tolerances are checked.
        tolerances: Tolerances; None to check no tolerances.
        stop_s: Duration [s] of the stop after a tolerance was exceeded; 0 stops at once.

    Attributes:
        code: Error code of the outcome, as in control_msgs/FollowJointTrajectoryResult.
        preempted: Whether another request ended the motion.
        desired: Desired states at the end of the last tick, keyed by joint index.
        on_advance: Function that is called at each tick with the world's time [s] and the measured joint states; or
            None.
    """

    can_wait = True
    not_in_keyframes = ("on_advance",)
    on_advance: Callable[[float, JointMotion], None] | None = None

    def __init__(
        self,
        joints: Mapping[int, Joint],
        trajectories: Mapping[int, Trajectory],
        from_s: float,
        tolerances: Tolerances | None = None,
        stop_s: float = 0.0,
    ) -> None:
        super().__init__(frozenset(trajectories))
        self.trajectories = dict(trajectories)
        self.from_s = from_s
        self.end_s = max(trajectory.end_s for trajectory in trajectories.values())
        self.code = ErrorCode.INVALID_GOAL  # unless the outcome has its own code
        self.preempted = False
        self.desired: dict[int, DesiredState] = {}
        self._joints = joints
        self._tolerances = tolerances
        self._stop_s = stop_s
        self._time_s = 0.0
        self._fault = ""

    def begin(self, time_s: float, measured: JointMotion) -> None:
        """Samples the trajectories at the world's present time [s]."""
        self._sample(time_s)

    def advance(self, time_s: float, measured: JointMotion) -> JointMotion:
        """Checks the tolerances, and returns the set points of the tick; stops the joints if a check fails."""
        if self.on_advance is not None:
            self.on_advance(self._time_s, measured)
        if fault := self._path_problem(measured):
            return self._break_off(ErrorCode.PATH_TOLERANCE_VIOLATED, fault, time_s, measured)
        if self._time_s >= self.end_s:
            goal = {} if self._tolerances is None else self._tolerances.goal
            if not (fault := self._fault_in(goal, measured, "its goal")):
                self._finish()
            elif self._is_out_of_time(time_s):
                return self._break_off(ErrorCode.GOAL_TOLERANCE_VIOLATED, fault, time_s, measured)
        return self._go_on(time_s)

    def preempt(self, reason: str) -> None:
        """Ends the motion because another request replaces it; the joints get no command."""
        if not self._fault:
            self.preempted, self.code = True, ErrorCode.SUCCESSFUL  # as in ros_controllers: no error
        self.end(False, self._fault or reason)

    def halt(self, reason: str, measured: JointMotion) -> None:
        """Ends the motion as a failure. The result contains the reason and the measured joint positions."""
        state = ", ".join(f"{self._joints[i].name}={measured[i][0]:.6g}" for i in sorted(self.joints))
        self.end(False, self._fault or f"{reason}; state reached: {state}")

    def _sample(self, time_s: float) -> None:
        self._time_s = time_s
        self.desired = {index: trajectory.sample(time_s) for index, trajectory in self.trajectories.items()}

    def _go_on(self, time_s: float) -> JointMotion:
        """Returns set points with which the joints reach their desired positions at the end of the tick."""
        before, duration_s = self.desired, time_s - self._time_s
        self._sample(time_s)
        return {
            index: (before[index].position[0], (state.position[0] - before[index].position[0]) / duration_s)
            for index, state in self.desired.items()
        }

    def _finish(self) -> None:
        if self._fault:
            self.end(False, self._fault)
        else:
            self.code = ErrorCode.SUCCESSFUL
            self.end(True, "reached the end" if self._tolerances is None else "reached the goal within its tolerances")

    def _break_off(self, code: ErrorCode, fault: str, time_s: float, measured: JointMotion) -> JointMotion:
        """Replaces the trajectories by trajectories on which the joints stop, and returns the set points of the tick.

        If the duration of the stop is 0, ends the motion at once.
        """
        self.code, self._fault = code, f"{fault}; the joints stop and hold where they are"
        self.trajectories = {i: stopping(self._joints[i], measured[i], self._time_s, self._stop_s) for i in self.joints}
        self.end_s, self._tolerances = self._time_s + self._stop_s, None
        if not self._stop_s:
            self._finish()
        self._sample(self._time_s)
        return self._go_on(time_s)

    def _is_out_of_time(self, time_s: float) -> bool:
        """Returns whether the time allowed for reaching the goal after the trajectory's end has passed.

        This time is at least one tick, because joints still move at the end of a trajectory without velocities.
        """
        tick_s = time_s - self._time_s
        return self._tolerances is not None and self._time_s > self.end_s + self._tolerances.goal_time_s + tick_s / 2.0

    def _path_problem(self, measured: JointMotion) -> str:
        """Returns a description of the first violated path tolerance, or an empty string."""
        if self._tolerances is None or not self.from_s <= self._time_s < self.end_s:
            return ""
        return self._fault_in(self._tolerances.path, measured, "its trajectory")

    def _fault_in(self, tolerances: Mapping[int, JointTolerance], measured: JointMotion, what: str) -> str:
        for index, tolerance in tolerances.items():
            if index not in self.joints:
                continue
            joint, desired, late_s = self._joints[index], self.desired[index], self._time_s - self.end_s
            when = f"{late_s:.3g} s after the end" if late_s >= 0.0 else f"{-late_s:.3g} s before the end"
            limits = zip(measured[index], (desired.position[0], desired.velocity[0]), tolerance)
            for (value, goal, limit), (unit, of) in zip(limits, (("", ""), ("/s", "the velocity of "))):
                if abs(value - goal) > limit:
                    off = f"{abs(value - goal):.6g} {joint.unit}{unit} off {of}{what}"
                    return f"joint '{joint.name}' is {off}, {when}; allowed are {limit:g}"
        return ""


def stopping(joint: Joint, measured: tuple[float, float], time_s: float, duration_s: float) -> Trajectory:
    """Returns a trajectory on which a joint stops, with constant deceleration unless a position limit is in the way.

    The end position is clipped to the joint's limits.

    Args:
        joint: The joint.
        measured: Measured position [rad or m] and velocity [rad/s or m/s] of the joint.
        time_s: The world's present time [s].
        duration_s: Duration of the stop [s]; 0 to hold the measured position at once.
    """
    position, velocity = measured
    if not duration_s:
        return Trajectory.through([Knot(time_s, (position,))])
    end = position + velocity * duration_s / 2.0
    end = min(max(end, min(joint.lower, position)), max(joint.upper, position))
    return Trajectory.through([Knot(time_s, (position,), (velocity,)), Knot(time_s + duration_s, (end,), (0.0,))])
