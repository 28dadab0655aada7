"""YAML keys of the main file."""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, ValidationInfo, create_model, model_validator

from custom_ros_tools.schema import (
    AlsoTakes,
    ConfigModel,
    FrameId,
    Hz,
    HzOrOff,
    KeyedError,
    ListOf,
    Name,
    NonNegative,
    Pixels,
    Position,
    Positive,
    Quat,
    Seconds,
    Switch,
    Text,
    Unit,
    Vec3,
    optional,
)
from custom_ros_tools.transforms import quat_of
from robot_model.asset_files import find_folder
from rpbi.geometry import Pose

from .object_entry import FileOrOverrides
from .pybullet_world_models import (
    ConfigureDebugVisualizer,
    Connect,
    ResetDebugVisualizerCamera,
    ResetSimulation,
    SetGravity,
    SetPhysicsEngineParameter,
)
from .sensors import RgbdSensorConfig


def _existing_folder(name: str, info: ValidationInfo) -> str:
    return find_folder(name, (info.context or {}).get("file", "~"))


def _as_list(given: Any) -> Any:
    return [given] if isinstance(given, str) else given


LONGEST_STEP_S = 10.0
MIN_REAL_TIME_FACTOR = 1e-3
"""Smallest real-time factor. With a smaller one, motions would last for hours and services would seem to hang."""


def checked_real_time_factor(factor: float) -> float:
    """Checks a real-time factor, and returns the factor.

    Raises:
        ValueError: If the factor is neither 0 (as fast as possible) nor a finite number >= MIN_REAL_TIME_FACTOR.
    """
    if factor == 0.0 or MIN_REAL_TIME_FACTOR <= factor < math.inf:
        return factor
    raise ValueError(f"must be 0 (as fast as possible) or >= {MIN_REAL_TIME_FACTOR:g}, got {factor:g}")


def _whole_nanoseconds(seconds: float) -> float:
    if seconds > LONGEST_STEP_S:
        raise ValueError(f"must be at most {LONGEST_STEP_S:g} [s], got {seconds:g}")
    if round(seconds * 1e9) < 1:
        raise ValueError(f"must be at least 1.0e-9 [s], got {seconds:g}")
    return seconds


Folders = Annotated[
    ListOf[Annotated[Text, AfterValidator(_existing_folder)]],
    BeforeValidator(_as_list),
    AlsoTakes({"type": "string", "minLength": 1}),
]


WORLD_FRAME = "rpbi/world"
"""The TF frame in which all poses are given."""


class StaticFrame(ConfigModel):
    """A TF frame with a fixed pose, which the interface publishes. No other node should publish the frame."""

    tf_id: FrameId = Field(description="Name of the frame.")
    parent: FrameId = Field(WORLD_FRAME, description="The frame that its pose is in.")
    position: Position = Field((0.0, 0.0, 0.0), description="Its position.")
    orientation: Quat | None = optional("Its orientation, x, y, z, w; none by default.")
    rpy: Annotated[Vec3, Unit("rad")] | None = optional(
        "Its orientation in other words: roll, pitch and yaw, about the fixed x, y and z one after the other."
    )

    @model_validator(mode="after")
    def _is_somewhere_in_one_way(self) -> Self:
        if self.tf_id in (WORLD_FRAME, self.parent):
            raise KeyedError("tf_id", f"expected another frame than {WORLD_FRAME} and the parent, got '{self.tf_id}'")
        if self.orientation is not None and self.rpy is not None:
            raise KeyedError("rpy", "says the same as orientation: give one of both")
        return self

    @property
    def pose(self) -> Pose:
        """Pose of the frame in its parent frame."""
        x, y, z, w = quat_of(self.rpy).tolist() if self.rpy else self.orientation or (0.0, 0.0, 0.0, 1.0)
        return Pose(self.position, (x, y, z, w))


class ControlsConfig(ConfigModel):
    """The window with buttons, see docs/windows.md."""

    robot_name: Text | None = optional("Robot whose joints it shows first; without it, the first one.")


class AttachmentPose(ConfigModel):
    """Pose of an attachment on a link, in the link's URDF frame."""

    position: Position = Field((0.0, 0.0, 0.0), description="Its position.")
    orientation: Quat = Field((0.0, 0.0, 0.0, 1.0), description="Its orientation, x, y, z, w.")

    @property
    def pose(self) -> Pose:
        """The position and orientation as a `Pose`."""
        return Pose(self.position, self.orientation)


class AttachmentConfig(ConfigModel):
    """An attachment, which ties a link of one body to a link of another body like a magnet or a tool changer."""

    name: Name = Field(description="Its name, by which it is detached.")
    parent: Text = Field(description="The parent: an object, or one of its links as NAME/LINK.")
    child: Text = Field(description="The child: likewise.")
    kind: Literal["fixed", "ball"] = Field("fixed", description="`fixed` holds the pose, `ball` the position alone.")
    parent_pose: AttachmentPose | None = optional(
        "Its place on the parent; by default the present one, so that nothing moves."
    )
    child_pose: AttachmentPose | None = optional(
        "Its place on the child; its origin if neither is given. If both are, they are pulled together."
    )
    max_force: Annotated[Positive, Unit("N")] | None = optional("Force that it breaks beyond; none by default.")


class WorldConfig(ConfigModel):
    """Keys of the main YAML file, except the lists of object files. `main_file_model` adds these lists."""

    model_config = ConfigDict(extra="ignore")

    connect: Connect = Field(Connect(), description="Connection to PyBullet.")
    setAdditionalSearchPath: Folders = Field(
        (), description="Folders to look for files in; `pybullet_data_path` is that of PyBullet's data."
    )
    resetSimulation: ResetSimulation = Field(ResetSimulation(), description="Kind of world.")
    setGravity: SetGravity = Field(SetGravity(), description="Gravity; there is none unless given.")
    timeStep: Annotated[Seconds, AfterValidator(_whole_nanoseconds)] = Field(0.02, description="Length of a step.")
    setPhysicsEngineParameter: SetPhysicsEngineParameter = Field(
        SetPhysicsEngineParameter(), description="Solver of contacts and joints."
    )
    real_time_factor: Annotated[NonNegative, AfterValidator(checked_real_time_factor)] = Field(
        1.0, description="Simulated seconds in a second of wall time, at least 0.001; 0 is as fast as possible."
    )
    clock_hz: Hz | None = optional("Most /clock messages in a second of wall time.")
    tf_prefix: FrameId | None = optional("Prefix of all TF frames, so that two worlds can share one TF tree.")
    step_pybullet_manually: Switch = Field(
        False, description="Accepted without effect: the interface does every step itself."
    )
    start_pybullet_after_initialization: Switch = Field(
        True, description="Whether the world runs at once, else from the first `rpbi/start`."
    )
    status_hz: Hz = Field(50.0, description="Rate of `rpbi/status`.")
    state_hz: HzOrOff = Field(10.0, description="Rate of `rpbi/state`, in wall time; 0 is off.")
    state_hash_hz: HzOrOff = Field(
        1.0, description="Rate of the hashes in `rpbi/state`, in the world's time, by which recordings are replayed."
    )
    keyframe_every_s: NonNegative = Field(
        0.0,
        description="Period of keyframes, in the world's time, at which saved states and replays begin; 0 is none.",
        json_schema_extra={"unit": "s"},
    )
    configureDebugVisualizer: ConfigureDebugVisualizer = Field(
        ConfigureDebugVisualizer(), description="Content of PyBullet's window."
    )
    resetDebugVisualizerCamera: ResetDebugVisualizerCamera = Field(
        ResetDebugVisualizerCamera(), description="Where PyBullet's window looks from."
    )
    enable_keyboard_publisher: Switch = Field(
        False, description="Whether keys pressed in PyBullet's window are on `rpbi/keyboard`."
    )
    enable_mouse_publisher: Switch = Field(
        False, description="Whether what the mouse does in PyBullet's window is on `rpbi/mouse`."
    )
    publish_visualizer_image_hz: HzOrOff = Field(
        0.0, description="Rate of `rpbi/visualizer_image`, what PyBullet's window shows, in wall time; 0 is off."
    )
    visualizer_image_width: Pixels = Field(640, description="Columns of that image.")
    visualizer_image_height: Pixels = Field(480, description="Its rows.")
    markers_hz: HzOrOff = Field(10.0, description="Rate of updates of `rpbi/markers`, in wall time; 0 is off.")
    controls: ControlsConfig | None = optional("The window with buttons that `./rpbi launch WORLD.yaml` opens.")
    poses: ListOf[StaticFrame] = Field((), description="Poses of TF frames that no other node publishes.")
    attachments: ListOf[AttachmentConfig] = Field((), description="Attachments from the start on.")
    objects: ListOf[FileOrOverrides] = Field(
        (), description="Files of objects of your own types, see docs/extending.md."
    )
    trusted_packages: ListOf[Text] = Field(
        (),
        description="Python packages from which services may import types, beside the types that are used at the "
        "start.",
    )
    rgbd_sensor: RgbdSensorConfig | None = optional(
        "Camera of colour, depth and segmentation; the first one if there are several."
    )
    rgbd_sensors: ListOf[FileOrOverrides] = Field((), description="Files of further cameras.")

    @model_validator(mode="after")
    def _frames_have_one_pose(self) -> Self:
        parents: dict[str, str] = {}
        for index, pose in enumerate(self.poses):
            if pose.tf_id in parents:
                raise KeyedError(f"poses[{index}].tf_id", f"'{pose.tf_id}' has a pose already")
            above = pose.parent
            while above in parents:
                above = parents[above]
            if above == pose.tf_id:
                raise KeyedError(f"poses[{index}].parent", f"'{pose.parent}' hangs on '{pose.tf_id}' itself")
            parents[pose.tf_id] = pose.parent
        return self

    def pose_of(self, frame: str) -> Pose | None:
        """Returns the pose of a TF frame in the world, computed from `poses`; None if a frame on the way is missing."""
        poses = {each.tf_id: each for each in self.poses}
        pose = Pose()
        while (frame := self.without_prefix(frame)) != WORLD_FRAME:
            if frame not in poses:
                return None
            step = poses.pop(frame)
            pose, frame = step.pose @ pose, step.parent
        return pose

    def without_prefix(self, frame: str) -> str:
        """Returns the name of a TF frame without a leading `tf_prefix`."""
        return frame if self.tf_prefix is None else frame.removeprefix(f"{self.tf_prefix}/")

    @classmethod
    def from_main_file(cls, content: WorldConfig) -> WorldConfig:
        """Returns the configuration of a validated main file, without the file's lists of objects."""
        values = {key: getattr(content, key) for key in cls.model_fields}
        return cls.model_construct(content.model_fields_set & cls.model_fields.keys(), **values)


def main_file_model(sections: Mapping[str, type[ConfigModel]]) -> type[WorldConfig]:
    """Returns the model of a main file with lists of object files; the model refuses unknown keys.

    Args:
        sections: Model of the files in each list, keyed by the list's name.
    """
    return _main_file_model(tuple(sections.items()))


@lru_cache(maxsize=10)
def _main_file_model(sections: tuple[tuple[str, type[ConfigModel]], ...]) -> type[WorldConfig]:
    lists: dict[str, Any] = {}
    for section, model in sections:
        about = inspect.cleandoc(model.__doc__ or "").split("\n")[0]
        lists[section] = (
            ListOf[FileOrOverrides],
            Field((), description=f"Files, each of {about[:1].lower()}{about[1:]}"),
        )
    return create_model(
        "MainFile",
        __base__=WorldConfig,
        __doc__="The main YAML file.",
        __cls_kwargs__={"extra": "forbid"},
        **{key: value for key, value in lists.items() if key not in WorldConfig.model_fields},
    )
