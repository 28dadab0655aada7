"""Motions to a goal in a given time."""

from collections.abc import Mapping

from rpbi.control.trajectories.trajectory import Trajectory, minimum_jerk
from rpbi.urdf.joints import JointModel

from .motion import JointMotion, Motion

TOLERANCES = {"rad": 0.01, "m": 0.001}
"""Largest error of a joint at the end by unit; beyond it, the motion fails."""
REST = {"rad": 0.05, "m": 0.005}
"""Speed below which a joint counts as at rest at its goal, by unit and second."""
SETTLING_S = 1.0
"""Longest time after the last set point until joints rest at the goal [s] of the world's time; then it fails."""
LONGEST_S = 1e6
"""Longest motion [s]; longer ones are refused as errors."""
SHORTEST_S = 0.04
"""Shortest duration of a motion [s], as in the first release; shorter ones are extended to it."""
PEAK = 15.0 / 8.0
"""Largest velocity of a minimum-jerk motion over its mean one: 30 s^2 (1 - s)^2 at s = 1/2 (Flash and Hogan, 1985)."""


class TimedMotion(Motion):
    """Moves joints to a goal with minimum jerk; it takes longer than asked if the joints' velocities demand it.

    It succeeds if the measured joints come to rest within `TOLERANCES` of the goal. Joints that are asked to go beyond
    their limits stop there, and the motion does not succeed. Joints that are not named are left alone.

    Args:
        goal: Positions [rad or m] by joint index.
        duration_s: Duration [s].

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
        """Plans the motion from the measured state."""
        start = [measured[index][0] for index in self._goal]
        shortest = max(
            PEAK * abs(goal - from_) / self._model.joints[index].max_velocity
            for from_, (index, goal) in zip(start, self._goal.items())
        )
        self._duration_s = min(max(self._asked_s, shortest), LONGEST_S)
        self._trajectory = minimum_jerk(start, list(self._goal.values()), time_s, self._duration_s)
        self._time_s, self._set_point = time_s, tuple(start)

    def advance(self, time_s: float, measured: JointMotion) -> JointMotion:
        """Follows the plan, then waits at the goal until the joints arrive or the time is over."""
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
        """Ends before the goal; the message includes the state reached."""
        self.end(False, f"{reason} before the goal: {self._residuals(measured)}; {self._reached(measured)}")

    def _missed(self, measured: JointMotion) -> list[int]:
        joints = self._model.joints
        return [i for i, goal in self._goal.items() if abs(measured[i][0] - goal) > TOLERANCES[joints[i].unit]]

    def _rests(self, measured: JointMotion) -> bool:
        return all(abs(measured[index][1]) <= REST[self._model.joints[index].unit] for index in self._goal)

    def _residuals(self, measured: JointMotion, indices: list[int] | None = None) -> str:
        """Returns the errors of joints as text: the largest of each unit, or all of `indices`."""
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
