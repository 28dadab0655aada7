"""The task `joint_limits`: keeps joint positions in ranges that are narrower than the URDF's limits."""

from pydantic import Field

from custom_ros_tools.schema import KeyedError, ListOf, NonNegative, Positive

from .joint_task import JointTask
from .robot import PinocchioRobot
from .task import TaskConfig, keyed_errors


class JointLimitsConfig(TaskConfig):
    """Options of the task `joint_limits`.

    Attributes:
        limits: Lower and upper limit by joint name [rad or m].
        margin: Smallest distance of all joints from the URDF's limits [rad or m].
    """

    limits: dict[str, ListOf[float]] = Field(default_factory=dict)
    margin: NonNegative = 0.0
    tolerance_rad: Positive = 1e-6


class JointLimits(JointTask):
    """Keeps joints within given limits; the URDF's limits are always kept, even without this task."""

    Config = JointLimitsConfig

    def __init__(self, config: JointLimitsConfig, robot: PinocchioRobot) -> None:
        super().__init__(config, robot, robot.joint_names, "limits")
        lower, upper = robot.lower + config.margin, robot.upper - config.margin
        for name, limits in config.limits.items():
            with keyed_errors(f"limits.{name}"):
                i = robot.index(name)
                if len(limits) != 2 or limits[0] > limits[1]:
                    raise ValueError(f"expected a lower and an upper limit, got {list(limits)}")
            lower[i], upper[i] = max(lower[i], limits[0]), min(upper[i], limits[1])
        for name, low, high in zip(robot.joint_names, lower, upper):
            if low > high:
                key = f"limits.{name}" if name in config.limits else "margin"
                raise KeyedError(key, f"leaves '{name}' no position: {low:g} to {high:g}")
        self.bounds = lower, upper
