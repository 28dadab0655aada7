"""The user's formulation of an inverse kinematics problem: robot, costs and constraints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator, Field, ValidationInfo, model_validator

from custom_ros_tools.errors import ConfigError, InterfaceError, UnknownNameError
from custom_ros_tools.schema import ConfigModel, Count, KeyedError, ListOf, Position, Quat, Switch, Text
from ik_ros.shape import ShapeConfig
from robot_model.asset_files import ExistingFile
from robot_model.geometry import Pose

from . import TASKS
from .frame_task import FrameTask
from .robot import PinocchioRobot
from .task import Task, TaskConfig, keyed_errors

WORLD = "world"
"""Default name of the frame in which poses are expressed if the robot has a floating base."""


def _of_its_type(value: Any, info: ValidationInfo) -> Any:
    """Validates the options of a task with the pydantic model that belongs to the task's type."""
    if not isinstance(value, Mapping):
        raise ValueError("expected a mapping with name, type and the options of the task")
    kind = value.get("type")
    if not isinstance(kind, str):
        raise KeyedError("type", "missing, expected the type of the task")
    try:
        return TASKS.find(kind).Config.parse(value, "")
    except ConfigError as error:
        raise KeyedError(error.problems[0].key, error.problems[0].message) from None
    except (UnknownNameError, ValueError) as error:
        raise KeyedError("type", str(error)) from None


AnyTask = Annotated[TaskConfig, BeforeValidator(_of_its_type)]


class FrameOnLinkConfig(ConfigModel):
    """A frame that is attached to a link, such as the tip of a tool.

    Attributes:
        name: Name of the frame, which tasks use like a link name.
        link: Name of the link.
        position: Position of the frame in the link's frame [m].
        orientation: Orientation of the frame in the link's frame, quaternion x, y, z, w.
    """

    name: Text
    link: Text
    position: Position = (0.0, 0.0, 0.0)
    orientation: Quat = (0.0, 0.0, 0.0, 1.0)


class Formulation(ConfigModel):
    """Options of the solver `tasks`.

    Attributes:
        urdf_filename: The robot's URDF; `{package}/path` and `package://` are resolved.
        floating_base: Whether the robot's root is free to move, as for legged robots.
        base_frame: Frame in which poses are expressed: a link, by default the root. With a floating base, the name of
            the world frame.
        base_position: Position of a floating root at the start of the search [m]. Has no effect if there is a
            constraint on the full pose of a link. Then the first of these constraints determines the start.
        base_orientation: Orientation of a floating root at the start of the search, quaternion x, y, z, w.
        joints: Joints to find positions for; by default all moving joints. Other joints keep their start positions.
        start: Start position by joint name [rad or m], for joints that a problem's start leaves out. Joints that this
            option leaves out as well start at the middle of their limits.
        frames: Frames attached to links; tasks can use the names of these frames like link names.
        shapes: Shapes of links and obstacles, for tasks of type `distance`.
        costs: Tasks whose errors are minimised.
        constraints: Tasks that have to be satisfied.
        main_task: Name of the task that takes a problem's target as the goal. None: the only task about the pose,
            position or orientation of a link.
        restarts: Number of random starts after the given start.
        iterations: Largest number of iterations from one start.
    """

    urdf_filename: ExistingFile
    floating_base: Switch = False
    base_frame: Text | None = None
    base_position: Position = (0.0, 0.0, 0.0)
    base_orientation: Quat = (0.0, 0.0, 0.0, 1.0)
    joints: ListOf[Text] = ()
    start: dict[str, float] = Field(default_factory=dict)
    frames: ListOf[FrameOnLinkConfig] = ()
    shapes: ListOf[ShapeConfig] = ()
    costs: ListOf[AnyTask] = ()
    constraints: ListOf[AnyTask] = ()
    main_task: Text | None = None
    restarts: Count = 30
    iterations: Annotated[int, Field(gt=0)] = 100

    @model_validator(mode="after")
    def _fits_the_robot(self) -> Formulation:
        for i, task in enumerate(self.constraints):
            if given := {"weight", "required"} & task.model_fields_set:
                raise KeyedError(f"constraints[{i}].{min(given)}", "is for costs; constraints are always required")
        if not (self.costs or self.constraints):
            raise KeyedError("costs", "expected a task, here or among the constraints")
        TaskSet(self)
        return self

    def entries(self) -> Iterator[tuple[str, TaskConfig]]:
        """Yields the key path and the options of each task."""
        for key in ("costs", "constraints"):
            for i, task in enumerate(getattr(self, key)):
                yield f"{key}[{i}]", task

    @property
    def base_start(self) -> Pose:
        """Pose of a floating root at the start of the search, in the base frame."""
        return Pose(self.base_position, self.base_orientation)


class Part(NamedTuple):
    """A task of a formulation, which is either a cost or a constraint.

    Attributes:
        task: The task.
        is_hard: Whether the task is a constraint.
    """

    task: Task
    is_hard: bool

    @property
    def is_required(self) -> bool:
        """Whether a solution counts as successful only if the task is met."""
        return self.is_hard or self.task.config.required


class TaskSet:
    """The robot and the tasks of a formulation.

    Attributes:
        robot: The robot.
        base_frame: Name of the frame in which poses are expressed.
        parts: All tasks, indexed by name, the costs first.
        main: Name of the task that takes a problem's target as the goal; None if the formulation has no such task.

    Raises:
        KeyedError: If an option does not fit the robot; the error names the key.
    """

    def __init__(self, formulation: Formulation) -> None:
        self.robot = _robot(formulation)
        self.base_frame = formulation.base_frame or (WORLD if formulation.floating_base else self.robot.links[0])
        self.parts: dict[str, Part] = {}
        for key, config in formulation.entries():
            if config.name in self.parts:
                raise KeyedError(f"{key}.name", f"there is another task '{config.name}'")
            with keyed_errors(key):
                task = TASKS.find(config.type)(config, self.robot)
            self.parts[config.name] = Part(task, key.startswith("constraints"))
        self.main = self._main(formulation.main_task)
        if self.main is not None and not self.parts[self.main].is_hard:
            task = self.parts[self.main].task
            task.config = task.config.model_copy(update={"required": True})

    @property
    def anchor(self) -> FrameTask | None:
        """The first constraint on all axes of a link's pose, which determines the start of a floating base, or None."""
        poses = (part.task for part in self.parts.values() if part.is_hard and isinstance(part.task, FrameTask))
        return next((task for task in poses if task.is_complete), None)

    def _main(self, name: str | None) -> str | None:
        about_links = [known for known, part in self.parts.items() if isinstance(part.task, FrameTask)]
        if name is None:
            return about_links[0] if len(about_links) == 1 else None
        if name not in about_links:
            raise KeyedError("main_task", str(UnknownNameError("task about a link", name, about_links)))
        return name


def _robot(formulation: Formulation) -> PinocchioRobot:
    floating, base = formulation.floating_base, formulation.base_frame
    try:
        robot = PinocchioRobot(formulation.urdf_filename, floating, formulation.joints, None if floating else base)
    except UnknownNameError as error:
        raise KeyedError("joints" if error.kind == "joint" else "base_frame", str(error)) from None
    except InterfaceError as error:
        raise KeyedError("urdf_filename", str(error)) from None
    for name in formulation.start:
        if name not in robot.all_joints:
            raise KeyedError("start", str(UnknownNameError("joint", name, robot.all_joints)))
    for i, frame in enumerate(formulation.frames):
        if frame.name in robot.links:
            raise KeyedError(f"frames[{i}].name", f"there is a link or another frame '{frame.name}'")
        with keyed_errors(f"frames[{i}].link"):
            robot.add_frame(frame.name, frame.link, Pose(frame.position, frame.orientation))
    for i, shape in enumerate(formulation.shapes):
        if shape.name in [other.name for other in formulation.shapes[:i]]:
            raise KeyedError(f"shapes[{i}].name", f"there is another shape '{shape.name}'")
        with keyed_errors(f"shapes[{i}].link"):
            robot.add_shape(shape)
    return robot
