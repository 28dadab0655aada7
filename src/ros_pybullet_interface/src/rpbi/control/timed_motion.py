"""Motions that move joints to goal positions within a requested duration."""

from collections.abc import Mapping

from rpbi.control.trajectories.trajectory import Trajectory, minimum_jerk
from rpbi.urdf.joints import JointModel

from .motion import JointMotion, Motion

TOLERANCES = {"rad": 0.01, "m": 0.001}
"""Largest position error [rad or m] with which a joint has reached its goal, keyed by the joint's unit."""
REST = {"rad": 0.05, "m": 0.005}
"""Speed [rad/s or m/s] up to which a joint counts as at rest, keyed by the joint's unit."""
SETTLING_S = 1.0
"""Time [s], in the world's time, that joints have after the last set point to come to rest at the goal."""
LONGEST_S = 1e6
"""Longest duration of a motion [s]; longer durations are refused."""
SHORTEST_S = 0.04
"""Shortest duration of a motion [s]; shorter durations are extended to this value."""
PEAK = 15.0 / 8.0
"""Ratio of the peak velocity to the mean velocity of a minimum-jerk motion (Flash and Hogan, 1985).

The ratio is the value of 30 s^2 (1 - s)^2 at s = 1/2.
"""


class TimedMotion(Motion):
    """Moves joints to goal positions with minimum jerk.

    The motion takes longer than `duration_s` if a joint would otherwise exceed its velocity limit. The motion succeeds
    if the measured joints come to rest within `TOLERANCES` of the goal. A goal beyond a joint's limits is clipped to
    the limit, and the motion then fails after the joint has reached the limit.

    Args:
        goal: Goal positions [rad or m], keyed by joint index.
        duration_s: Requested duration [s].

    Raises:
        ValueError: If the goal is empty, or the duration is negative or not finite.
    """

    def __init__(self, model: JointModel, goal: Mapping[int, float], duration_s: float) -> None:
        if not goal:
            raise ValueError("expected a position for one joint or more, got none")
        if not 0.0 <= duration_s <= LONGEST_S:
            raise ValueError(f"duration must be 0 to {LONGEST_S:g} [s], got {duration_s:g}")
        super().__init__(frozenset(goal))
        self._model = model
        self._beyond = model.limit_violations(goal)
        self._goal = {index: model.joints[index].nearest_allowed(position) for index, position in goal.items()}
        self._asked_s = max(duration_s, SHORTEST_S)
        self._trajectory: Trajectory

    def begin(self, time_s: float, measured: JointMotion) -> None:
        """Plans the motion, which starts at rest from the measured positions."""
        start = [measured[index][0] for index in self._goal]
        shortest = max(
            PEAK * abs(goal - from_) / self._model.joints[index].max_velocity
            for from_, (index, goal) in zip(start, self._goal.items())
        )
        self._duration_s = min(max(self._asked_s, shortest), LONGEST_S)
        self._trajectory = minimum_jerk(start, list(self._goal.values()), time_s, self._duration_s)
        self._time_s, self._set_point = time_s, tuple(start)

    def advance(self, time_s: float, measured: JointMotion) -> JointMotion:
        """Follows the plan. After the plan's end, holds the goal until the joints rest or `SETTLING_S` has passed."""
        if time_s > self._trajectory.end_s + 1e-9:
            missed = self._missed(measured)
            if not missed and self._rests(measured):
                reached = f"{self._residuals(measured)}{self._stretched()}"
                if self._beyond:
                    self.end(False, f"went to the limits only: {'; '.join(self._beyond)}; {reached}")
                else:
                    self.end(True, f"reached: {reached}")
            elif time_s > self._trajectory.end_s + SETTLING_S:
                why = "missed the goal" if missed else "still oscillates about the goal"
                self.end(False, f"{why}: {self._residuals(measured, missed or None)}; {self._reached(measured)}")
        before, duration_s = self._set_point, time_s - self._time_s
        self._set_point, self._time_s = self._trajectory.sample(time_s).position, time_s
        return {
            index: (start, (end - start) / duration_s) for index, start, end in zip(self._goal, before, self._set_point)
        }

    def halt(self, reason: str, measured: JointMotion) -> None:
        """Ends the motion before its goal. The message of the result gives the reason and the measured positions."""
        self.end(False, f"{reason} before the goal: {self._residuals(measured)}; {self._reached(measured)}")

    def _missed(self, measured: JointMotion) -> list[int]:
        joints = self._model.joints
        return [i for i, goal in self._goal.items() if abs(measured[i][0] - goal) > TOLERANCES[joints[i].unit]]

    def _rests(self, measured: JointMotion) -> bool:
        return all(abs(measured[index][1]) <= REST[self._model.joints[index].unit] for index in self._goal)

    def _residuals(self, measured: JointMotion, indices: list[int] | None = None) -> str:
        """Returns the errors of joints `indices` as text; by default, the largest error in rad and the largest in m."""
        errors = {index: abs(measured[index][0] - goal) for index, goal in self._goal.items()}
        joints = self._model.joints
        if indices is None:
            kinds = {joints[index].unit for index in errors}
            indices = [max((i for i in errors if joints[i].unit == unit), key=errors.__getitem__) for unit in kinds]
        return ", ".join(
            f"joint '{joints[i].name}' is {errors[i]:.3g} {joints[i].unit} from its goal" for i in sorted(indices)
        )

    def _reached(self, measured: JointMotion) -> str:
        state = ", ".join(f"{self._model.joints[i].name}={measured[i][0]:.6g}" for i in self._goal)
        return f"state reached: {state}"

    def _stretched(self) -> str:
        if self._duration_s <= self._asked_s:
            return ""
        return f"; it took {self._duration_s:.3g} s rather than {self._asked_s:.3g} s to keep to the joints' velocities"
