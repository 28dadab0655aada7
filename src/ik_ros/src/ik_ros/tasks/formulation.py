"""A user's problem formulation: the robot, the costs and the constraints."""

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
"""Default frame of poses for a floating base."""


def _of_its_type(value: Any, info: ValidationInfo) -> Any:
    """Returns the options of a task, validated by the model of its type."""
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
    """A frame at a link, such as the tip of a tool.

    Attributes:
        name: Its name in tasks.
        link: The link.
        position: Position in the link [m].
        orientation: Orientation in it, quaternion x, y, z, w.
    """

    name: Text
    link: Text
    position: Position = (0.0, 0.0, 0.0)
    orientation: Quat = (0.0, 0.0, 0.0, 1.0)


class Formulation(ConfigModel):
    """Options of the solver `tasks`.

    Attributes:
        urdf_filename: The robot; `{package}/path` and `package://` are resolved.
        floating_base: Whether the root of the robot is free, as that of a robot on legs is.
        base_frame: Frame of poses: a link, by default the root; with a floating base any name.
        base_position: Position of a floating root at the start of the search [m]; only without a constraint of type
            `frame_pose`, the first of which determines it.
        base_orientation: Orientation of the floating root at the start, quaternion x, y, z, w.
        joints: The joints to find positions for; by default all that move. The others keep their start positions.
        start: Default start of joints that a problem's start leaves out [rad or m]; else the middle of their limits.
        frames: Frames at links; tasks can use their names like those of links.
        shapes: Shapes of links and obstacles in tasks of type `distance`.
        costs: Tasks to minimise.
        constraints: Tasks that have to be satisfied.
        main_task: Name of the task that uses the target of problems; None: the only task about the pose or position of
            a link.
        restarts: Number of random starts after the given one.
        iterations: Most iterations from one start.
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
        """Pose of a floating root at the start of the search."""
        return Pose(self.base_position, self.base_orientation)


class Part(NamedTuple):
    """One task of a formulation.

    Attributes:
        task: The task.
        is_hard: Whether it is a constraint.
    """

    task: Task
    is_hard: bool

    @property
    def is_required(self) -> bool:
        """Whether success requires it."""
        return self.is_hard or self.task.config.required


class TaskSet:
    """A formulation, with its robot.

    Attributes:
        robot: The robot.
        base_frame: Frame of poses.
        parts: Its tasks by name; the costs first.
        main: The task that uses targets, if any.

    Raises:
        KeyedError: If something does not fit the robot; it names the key.
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
        """The first constraint on the pose of a link, which places a floating base."""
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
