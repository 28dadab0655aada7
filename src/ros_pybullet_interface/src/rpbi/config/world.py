"""YAML keys of the main file."""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, ValidationInfo, create_model, model_validator
from typing_extensions import Self

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

from .contact_presets import WithContactPreset
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

    tf_id: FrameId = Field(description="Name of the TF frame.")
    parent: FrameId = Field(WORLD_FRAME, description="Parent frame, in which position and orientation are given.")
    position: Position = Field((0.0, 0.0, 0.0), description="Position in the parent frame.")
    orientation: Quat | None = optional(
        "Orientation in the parent frame, x, y, z, w. By default, the frame is not rotated."
    )
    rpy: Annotated[Vec3, Unit("rad")] | None = optional(
        "Orientation in the parent frame as roll, pitch and yaw about the fixed x, y and z axes, in this order; "
        "instead of `orientation`."
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

    robot_name: Text | None = optional("Robot whose joints the window shows first. By default, the first robot.")


class AttachmentPose(ConfigModel):
    """Pose of an attachment on a link, in the link's URDF frame."""

    position: Position = Field((0.0, 0.0, 0.0), description="Position in the link's URDF frame.")
    orientation: Quat = Field((0.0, 0.0, 0.0, 1.0), description="Orientation in the link's URDF frame, x, y, z, w.")

    @property
    def pose(self) -> Pose:
        """The position and orientation as a `Pose`."""
        return Pose(self.position, self.orientation)


class AttachmentConfig(ConfigModel):
    """An attachment, which ties a link of one body to a link of another body like a magnet or a tool changer."""

    name: Name = Field(description="Unique name of the attachment; `rpbi/detach` expects this name.")
    parent: Text = Field(description="Body that holds the child: NAME, or NAME/LINK for one of its links.")
    child: Text = Field(description="Body that is held: NAME, or NAME/LINK for one of its links.")
    kind: Literal["fixed", "ball"] = Field(
        "fixed", description="`fixed` holds position and orientation, `ball` holds the position only."
    )
    parent_pose: AttachmentPose | None = optional(
        "Pose of the attachment in the URDF frame of the parent's link. By default, computed from `child_pose` such "
        "that the bodies do not move."
    )
    child_pose: AttachmentPose | None = optional(
        "Pose of the attachment in the URDF frame of the child's link. By default, computed from `parent_pose` such "
        "that the bodies do not move, or the origin if both are missing. If both are given, the bodies are pulled "
        "together."
    )
    max_force: Annotated[Positive, Unit("N")] | None = optional(
        "Force above which the attachment breaks. By default, it never breaks."
    )


class WorldConfig(WithContactPreset):
    """Keys of the main YAML file, except the lists of object files. `main_file_model` adds these lists."""

    model_config = ConfigDict(extra="ignore")

    connect: Connect = Field(Connect(), description="Connection to PyBullet.")
    setAdditionalSearchPath: Folders = Field(
        (), description="Folders in which files are searched; `pybullet_data_path` stands for PyBullet's data folder."
    )
    resetSimulation: ResetSimulation = Field(
        ResetSimulation(), description="Kind of PyBullet world, for instance for soft bodies."
    )
    setGravity: SetGravity = Field(SetGravity(), description="Gravity. By default, there is no gravity.")
    timeStep: Annotated[Seconds, AfterValidator(_whole_nanoseconds)] = Field(0.02, description="Duration of a tick.")
    setPhysicsEngineParameter: SetPhysicsEngineParameter = Field(
        SetPhysicsEngineParameter(), description="Parameters of the physics engine."
    )
    real_time_factor: Annotated[NonNegative, AfterValidator(checked_real_time_factor)] = Field(
        1.0, description="Simulated seconds per second of wall time, at least 0.001; 0 runs as fast as possible."
    )
    clock_hz: Hz | None = optional(
        "Largest rate of /clock messages, in wall time. By default, 250 Hz with `real_time_factor: 0`, otherwise "
        "the rate of the ticks, at most 1000 Hz."
    )
    tf_prefix: FrameId | None = optional(
        "Prefix of all TF frames, so that two worlds can share one TF tree. By default, frames have no prefix."
    )
    step_pybullet_manually: Switch = Field(
        False, description="Accepted without effect: the interface makes every step itself."
    )
    start_pybullet_after_initialization: Switch = Field(
        True,
        description="Whether the simulation starts at once; otherwise it starts at the first call of `rpbi/start`.",
    )
    status_hz: Hz = Field(50.0, description="Rate of `rpbi/status`, in wall time.")
    state_hz: HzOrOff = Field(10.0, description="Rate of `rpbi/state`, in wall time; 0 is off.")
    state_hash_hz: HzOrOff = Field(
        1.0,
        description="Rate of the state hashes in `rpbi/state`, in simulated time; replays of recordings compare "
        "these hashes.",
    )
    keyframe_every_s: NonNegative = Field(
        0.0,
        description="Time between two keyframes, in simulated time; saved states and replays begin at a keyframe. 0 "
        "disables keyframes.",
        json_schema_extra={"unit": "s"},
    )
    configureDebugVisualizer: ConfigureDebugVisualizer = Field(
        ConfigureDebugVisualizer(), description="Rendering options of PyBullet's window."
    )
    resetDebugVisualizerCamera: ResetDebugVisualizerCamera = Field(
        ResetDebugVisualizerCamera(), description="Viewpoint of PyBullet's window."
    )
    enable_keyboard_publisher: Switch = Field(
        False, description="Whether key events of PyBullet's window are published on `rpbi/keyboard`."
    )
    enable_mouse_publisher: Switch = Field(
        False, description="Whether mouse events of PyBullet's window are published on `rpbi/mouse`."
    )
    publish_visualizer_image_hz: HzOrOff = Field(
        0.0, description="Rate of `rpbi/visualizer_image`, the image in PyBullet's window, in wall time; 0 is off."
    )
    visualizer_image_width: Pixels = Field(640, description="Width of the images on `rpbi/visualizer_image`.")
    visualizer_image_height: Pixels = Field(480, description="Height of the images on `rpbi/visualizer_image`.")
    markers_hz: HzOrOff = Field(10.0, description="Largest rate of `rpbi/markers`, in wall time; 0 is off.")
    controls: ControlsConfig | None = optional("Window with buttons that `./rpbi launch WORLD.yaml` opens.")
    poses: ListOf[StaticFrame] = Field((), description="TF frames with fixed poses, which no other node publishes.")
    attachments: ListOf[AttachmentConfig] = Field(
        (), description="Attachments between bodies that exist from the start."
    )
    objects: ListOf[FileOrOverrides] = Field(
        (), description="Files of objects of your own types; see docs/extending.md."
    )
    trusted_packages: ListOf[Text] = Field(
        (),
        description="Python packages from which services may import types, in addition to the types that the world "
        "uses at the start.",
    )
    rgbd_sensor: RgbdSensorConfig | None = optional(
        "RGB-D camera with colour, depth and segmentation images; the first one if there are several."
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
        """Returns the pose of a TF frame in the world frame, computed from `poses`.

        Returns None if `poses` contains no chain of frames from this frame to the world frame.
        """
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
