"""Configuration of a robot's trajectory controller, with key names as in ros_controllers' JointTrajectoryController."""

from collections.abc import Iterable
from typing import Annotated, Any

from pydantic import ConfigDict, Field, model_validator

from custom_ros_tools.errors import Problem, hint
from custom_ros_tools.schema import ConfigModel, Hz, KeyedError, ListOf, Switch, Text, Unit

SecondsOrNone = Annotated[float, Field(ge=0), Unit("s")]
Tolerance = Annotated[float, Field(ge=0), Unit("rad or m")]
SpeedTolerance = Annotated[float, Field(ge=0), Unit("rad/s or m/s")]


class JointConstraints(ConfigModel):
    """Tolerances of one joint."""

    trajectory: Tolerance = Field(
        0.0, description="Largest distance of the joint from the trajectory during the motion; 0 is no limit."
    )
    goal: Tolerance = Field(
        0.0, description="Largest distance of the joint from the goal at the end of the motion; 0 is no limit."
    )


class TrajectoryConstraints(ConfigModel):
    """Tolerances of trajectory goals. Each further key is a joint's name, with the tolerances of the joint."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, JointConstraints]

    goal_time: SecondsOrNone = Field(
        0.0, description="Time after the end of the trajectory within which joints must reach the goal."
    )
    stopped_velocity_tolerance: SpeedTolerance = Field(
        0.01, description="Largest speed at which a joint counts as stopped at its goal; 0 is no limit."
    )

    @model_validator(mode="before")
    @classmethod
    def _joints_have_mappings(cls, data: Any) -> Any:
        """Reports an unknown key whose value is not a mapping as a misspelt key, rather than as a joint's name."""
        for key, value in data.items() if isinstance(data, dict) else ():
            if key not in cls.model_fields and not isinstance(value, (dict, JointConstraints)):
                raise KeyedError(key, f"unknown key '{key}'{hint(key, cls.model_fields)}; joints have mappings")
        return data

    @property
    def by_joint(self) -> dict[str, JointConstraints]:
        """The constraints of single joints, keyed by joint name."""
        return self.__pydantic_extra__


class JointTrajectoryControllerConfig(ConfigModel):
    """Configuration of a robot's trajectory follower."""

    joints: ListOf[Text] | None = Field(
        None, min_length=1, description="Joints that the controller drives. By default, all joints that can be driven."
    )
    constraints: TrajectoryConstraints = Field(TrajectoryConstraints(), description="Tolerances of the joints.")
    stop_trajectory_duration: SecondsOrNone = Field(
        0.0, description="Time in which joints stop when a trajectory is cancelled or aborted; 0 stops them at once."
    )
    state_publish_rate: Hz = Field(50.0, description="Rate of the state topic.")
    action_monitor_rate: Hz = Field(20.0, description="Rate of the action's feedback messages.")
    allow_partial_joints_goal: Switch = Field(
        False, description="Whether a trajectory may omit joints of the controller."
    )


def trajectory_problems(
    name: str, config: JointTrajectoryControllerConfig | None, driven: Iterable[str]
) -> list[Problem]:
    """Returns the problems of a configuration for a robot.

    Args:
        name: Name of the robot.
        config: The configuration; None has no problems.
        driven: Names of the robot's joints that motors can drive.
    """
    if config is None:
        return []
    known = set(driven)
    if not known:
        return [Problem(name, "joint_trajectory_controller", "the robot has no joint that can be driven")]
    problems = []
    for index, joint in enumerate(config.joints or ()):
        key = f"joint_trajectory_controller.joints[{index}]"
        if joint not in known:
            problems.append(Problem(name, key, f"no joint '{joint}' that can be driven{hint(joint, known)}"))
        elif joint in (config.joints or ())[:index]:
            problems.append(Problem(name, key, f"joint '{joint}' is named twice"))
    for joint in config.constraints.by_joint:
        if joint not in known:
            key = f"joint_trajectory_controller.constraints.{joint}"
            problems.append(Problem(name, key, f"no joint '{joint}' that can be driven{hint(joint, known)}"))
    return problems
