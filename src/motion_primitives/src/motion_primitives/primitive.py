"""Base class of movement primitives, and the motion plans that they return."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Positive
from custom_ros_tools.transforms import Array

from .demonstration import Demonstration, common_space
from .dynamics import TOLERANCE, TOLERANCE_RAD, Coupling, Execution
from .errors import GoalNotReachedError, NotLearnedError, PlanError
from .space import Space

DT_S = 0.01
"""Default time between two points of a plan [s]."""
MAX_LONGER = 3.0
"""Multiple of the planned duration after which a goal that has not been reached counts as unreachable."""
MIN_STEPS, MAX_STEPS = 20, 1_000_000
"""Smallest and largest number of steps within a plan's duration. Time steps that give fewer steps are reduced, and time
steps that give more steps are rejected."""


class ViaPoint(NamedTuple):
    """A point that a motion passes through.

    Attributes:
        progress: Time at which the motion passes the point, as a fraction of the duration.
        point: The point, see `Space`.
        std: Allowed standard deviation of the motion from the point [m or rad].
    """

    progress: float
    point: Any
    std: float = 1e-5


@dataclass(frozen=True)
class MotionPlan:
    """A planned motion.

    Attributes:
        space: Space of the points.
        times: m times, starting at 0 [s].
        points: m points, see `Space`.
        velocities: m velocities, shape (m, dof) [m/s or rad/s]; with orientations, the last three columns are the
            angular velocity.
    """

    space: Space
    times: Array
    points: Array
    velocities: Array

    @property
    def duration_s(self) -> float:
        """Time of the last point [s]."""
        return float(self.times[-1])

    @property
    def positions(self) -> Array:
        """The n positions of all m points, shape (m, n) [m or rad]."""
        return self.points[:, : len(self.space.names)]

    @property
    def quats_xyzw(self) -> Array | None:
        """The unit quaternions x, y, z, w of all m points, shape (m, 4); None for a space without orientation."""
        return self.points[:, len(self.space.names) :] if self.space.has_orientation else None


class PrimitiveConfig(ConfigModel):
    """Options that every primitive has."""

    alpha: Positive = Field(
        25.0,
        description="Damping coefficient of the spring that pulls to the planned motion, for a duration of 1 s; the "
        "spring's stiffness is a quarter of the square of this coefficient. With larger values, the motion follows "
        "the plan more closely and yields less.",
    )


class Primitive(ABC):
    """Base class of primitives, which learn a motion from demonstrations and repeat it with new starts and goals.

    Attributes:
        Config: Pydantic model of the options.
        Learned: Pydantic model of the learned data in files.
        config: The options.
        space: Space of the motion's points; available after `learn` or `restore`.
    """

    Config: ClassVar[type[PrimitiveConfig]] = PrimitiveConfig
    Learned: ClassVar[type[ConfigModel]]

    def __init__(self, config: Any = None) -> None:
        self.config: Any = self.Config() if config is None else config
        self._space: Space | None = None

    @property
    def is_learned(self) -> bool:
        """True if the primitive has learned from demonstrations or was loaded from a file."""
        return self._space is not None

    @property
    def space(self) -> Space:
        """Space of the motion's points.

        Raises:
            NotLearnedError: If the primitive has not learned yet.
        """
        if self._space is None:
            raise NotLearnedError()
        return self._space

    def learn(self, demonstrations: Demonstration | Sequence[Demonstration]) -> Primitive:
        """Learns from demonstrations, which replaces all data learned before, and returns the primitive itself.

        Raises:
            DemonstrationError: If the demonstrations have different spaces, or are unsuitable for the primitive.
        """
        given = [demonstrations] if isinstance(demonstrations, Demonstration) else list(demonstrations)
        space = common_space(given)
        self._learn(space, given)
        self._space = space
        return self

    def begin(
        self,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        duration_s: float | None = None,
        via_points: Sequence[ViaPoint] = (),
        velocity: ArrayLike | None = None,
    ) -> Execution:
        """Begins a motion, and returns the execution, which the caller advances step by step.

        Args:
            start: First point; by default the demonstrations' mean first point.
            goal: Last point, or centre of a rhythmic motion; by default the mean of the demonstrations' goals.
            duration_s: Duration [s]; by default the demonstrations' mean duration.
            via_points: Points that the motion passes through, for primitives that support via-points.
            velocity: Velocity at the start, shape (dof,) [m/s or rad/s]; by default 0.

        Raises:
            NotLearnedError: If the primitive has not learned yet.
            PlanError: If an argument is invalid.
        """
        space = self.space
        if duration_s is not None and not 0.0 < duration_s < math.inf:
            raise PlanError("duration", "a finite time above 0 s", f"{duration_s}")
        speed = np.zeros(space.dof) if velocity is None else _checked_velocity(velocity, space)
        return self._begin(
            None if start is None else space.point(start, "start"),
            None if goal is None else space.point(goal, "goal"),
            duration_s,
            _checked_via_points(via_points, space),
            speed,
        )

    def plan(
        self,
        start: ArrayLike | None = None,
        goal: ArrayLike | None = None,
        duration_s: float | None = None,
        via_points: Sequence[ViaPoint] = (),
        velocity: ArrayLike | None = None,
        dt_s: float = DT_S,
        couplings: Sequence[Coupling] = (),
        tolerance: float = TOLERANCE,
        tolerance_rad: float = TOLERANCE_RAD,
    ) -> MotionPlan:
        """Plans a whole motion, from start to goal.

        For the arguments from `start` to `velocity`, see `begin`. The plan is longer than the duration if the goal is
        reached later, which may be caused by couplings or by the type of the primitive.

        Args:
            dt_s: Largest time between two points [s]. The actual time divides the duration into equal steps.
            couplings: Functions that return accelerations to add, see `Coupling`.
            tolerance: Largest difference of a position from the goal that counts as reached [m or rad].
            tolerance_rad: Largest angle between the orientations that counts as reached [rad].

        Raises:
            NotLearnedError: If the primitive has not learned yet.
            PlanError: If an argument is invalid.
            GoalNotReachedError: If the goal is not reached after three times the duration.
        """
        execution = self.begin(start, goal, duration_s, via_points, velocity)
        if not 0.0 < dt_s < math.inf or execution.end_s / dt_s > MAX_STEPS:
            least = execution.end_s / MAX_STEPS
            raise PlanError("dt", f"a time step above {least:.3g} s", f"{dt_s}")
        count = max(math.ceil(execution.end_s / dt_s - 1e-9), MIN_STEPS)
        dt_s, end_s = execution.end_s / count, execution.end_s
        states = [execution.state, *(execution.step(dt_s, couplings) for _ in range(count))]
        while not execution.is_at_goal(tolerance, tolerance_rad):
            if execution.state.time_s > MAX_LONGER * end_s:
                raise GoalNotReachedError(*execution.miss(), execution.state.time_s, tolerance, tolerance_rad)
            states.append(execution.step(dt_s, couplings))
        times, points, velocities = (np.array(each) for each in zip(*states))
        return MotionPlan(self.space, times, points, velocities)

    def learned(self) -> ConfigModel:
        """Returns the learned data, to be saved in a file.

        Raises:
            NotLearnedError: If the primitive has not learned yet.
        """
        if self._space is None:
            raise NotLearnedError()
        return self._learned()

    def restore(self, space: Space, learned: Any) -> None:
        """Replaces the learned data by the content of a file.

        Args:
            space: Space of the motion's points.
            learned: The learned data, an instance of `Learned`.

        Raises:
            ValueError: If array sizes in the data do not fit the space or the options.
        """
        self._restore(space, learned)
        self._space = space

    # --- For subclasses

    @abstractmethod
    def _learn(self, space: Space, demonstrations: Sequence[Demonstration]) -> None:
        """Learns from demonstrations that all have the space `space`; see `learn`."""

    @abstractmethod
    def _begin(
        self,
        start: Array | None,
        goal: Array | None,
        duration_s: float | None,
        via_points: Sequence[ViaPoint],
        velocity: Array,
    ) -> Execution:
        """Begins a motion with arguments that `begin` has checked."""

    @abstractmethod
    def _learned(self) -> ConfigModel:
        """Returns the learned data; see `learned`."""

    @abstractmethod
    def _restore(self, space: Space, learned: Any) -> None:
        """Sets the learned data; see `restore`."""


def check_shape(values: Any, shape: Mapping[str, int], subject: str) -> Array:
    """Converts numbers from a file to an array, and checks its shape.

    Args:
        values: The numbers.
        shape: Expected size of each array dimension, indexed by the dimension's name in error messages.
        subject: Name of the numbers in error messages.

    Raises:
        ValueError: If the shape differs.
    """
    try:
        array = np.array(values, dtype=float)
    except ValueError:
        array = np.zeros(0)
    if array.shape != tuple(shape.values()):
        expected = " x ".join(f"{size} {name}" for name, size in shape.items())
        raise ValueError(f"{subject}: expected {expected}, got shape {array.shape or 'of rows of different lengths'}")
    return array


def no_via_points(via_points: Sequence[ViaPoint]) -> None:
    """Raises an error if there are via-points. Primitives that do not support via-points call this function.

    Raises:
        PlanError: If the list is not empty.
    """
    if via_points:
        raise PlanError("via_points", "none, since this primitive does not support them", f"{len(via_points)}")


def _checked_velocity(velocity: ArrayLike, space: Space) -> Array:
    array = np.array(velocity, dtype=float)
    if array.shape != (space.dof,) or not np.isfinite(array).all():
        raise PlanError("velocity", f"{space.dof} finite numbers", str(velocity))
    return array


def _checked_via_points(via_points: Sequence[ViaPoint], space: Space) -> list[ViaPoint]:
    checked = []
    for index, each in enumerate(via_points):
        subject = f"via_points[{index}]"
        if not 0.0 <= each.progress <= 1.0:
            raise PlanError(f"{subject}.progress", "a share of the duration from 0 to 1", f"{each.progress}")
        if not 0.0 <= each.std < math.inf:
            raise PlanError(f"{subject}.std", "a standard deviation of at least 0", f"{each.std}")
        checked.append(ViaPoint(each.progress, space.point(each.point, subject), each.std))
    return checked
