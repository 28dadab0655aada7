"""Configuration of `interpolation_node.py`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, model_validator
from scipy.spatial.transform import Rotation

from custom_ros_tools.schema import (
    ConfigModel,
    Count,
    Degrees,
    Direction,
    FrameId,
    KeyedError,
    ListOf,
    Metres,
    Seconds,
    Switch,
    Text,
    TopicName,
    optional,
)
from robot_model.geometry import Pose, Quaternion, normalized

from .limits import MotionLimitsConfig

AXES = ("x", "y", "z")
MIN_NORM = 1e-6
"""Norm below which a quaternion counts as zero."""
MAX_CONSUMING_HZ = 200.0
"""Upper limit of the parameter `consuming_freq` [Hz]."""
ROWS_OF = {"theta": 1, "euler": 3, "quat": 4, "axis_angle": 3}
"""Number of rows that a planned rotation takes, keyed by `rotation_repr`."""

_LowerCase = BeforeValidator(lambda value: value.lower() if isinstance(value, str) else value)


class WaypointError(ValueError):
    """Waypoints cannot be followed. The message names the key, the expected value and the actual value."""


class InterpolationParameters(ConfigModel):
    """Private parameters of `interpolation_node.py`."""

    traj_config: Text = Field(description="YAML file of the motion: a path or `{package}/path`.")
    consuming_freq: Annotated[float, Field(gt=0, le=MAX_CONSUMING_HZ)] = Field(
        100.0, description="Largest rate of targets [Hz], in ROS time."
    )
    namespace: str = Field("", description="Prefix of the TF frame that is the target.")


class TranslationConfig(ConfigModel):
    """Position of the target frame. Each coordinate is constant or taken from a row of the waypoint matrix."""

    translation_x: Metres | None = optional("Constant x. By default, x is planned from `translation_x_index`.")
    translation_x_index: Count | None = optional(
        "Index of the waypoint row with x, without counting the row of times; required if x is planned."
    )
    translation_y: Metres | None = optional("Constant y. By default, y is planned from `translation_y_index`.")
    translation_y_index: Count | None = optional(
        "Index of the waypoint row with y, without counting the row of times; required if y is planned."
    )
    translation_z: Metres | None = optional("Constant z. By default, z is planned from `translation_z_index`.")
    translation_z_index: Count | None = optional(
        "Index of the waypoint row with z, without counting the row of times; required if z is planned."
    )

    def axis(self, name: str) -> tuple[float | None, int | None]:
        """Returns the constant coordinate [m] and the row index of axis `x`, `y` or `z`; None for a missing value."""
        return getattr(self, f"translation_{name}"), getattr(self, f"translation_{name}_index")


class RotationConfig(ConfigModel):
    """Orientation of the target frame: constant, or taken from rows of the waypoint matrix."""

    rotation_repr: Annotated[Literal["none", "theta", "euler", "quat", "axis_angle"], _LowerCase] = Field(
        "none",
        description="Representation of the orientation. `none`: constant; `theta`: angle about `rotation_vec` [rad]; "
        "`euler`: intrinsic rotations about z, y, x [rad]; `quat`: x, y, z, w; `axis_angle`: rotation vector [rad].",
    )
    rotation_vec: Direction | None = optional("Axis of the rotation, for `none` and `theta`.")
    rotation_angle: Degrees | None = optional("Constant angle about `rotation_vec`, for `none`.")
    rotation_vec_index: ListOf[Count] | None = optional(
        "Indices of the waypoint rows with the orientation: `[row]` for `theta`, otherwise `[first row, last row + 1]`."
    )
    shortest_path: Switch = Field(
        False, description="Whether `theta` and `euler` follow the shortest rotation, otherwise the full angles."
    )

    @property
    def rows(self) -> range:
        """Indices of the waypoint rows that contain the orientation; empty for a constant orientation."""
        if self.rotation_repr == "none" or not self.rotation_vec_index:
            return range(0)
        return range(self.rotation_vec_index[0], self.rotation_vec_index[0] + ROWS_OF[self.rotation_repr])

    @property
    def is_path(self) -> bool:
        """Whether the orientation's rows are interpolated together as a rotation, not one by one as numbers."""
        return self.rotation_repr in ("quat", "axis_angle") or (self.rotation_repr != "none" and self.shortest_path)

    def quat(self, values: Sequence[float]) -> Quaternion:
        """Converts the values in the rows `rows`, which have the form `rotation_repr`, to a quaternion x, y, z, w.

        Raises:
            WaypointError: If a quaternion is zero.
        """
        match self.rotation_repr:
            case "none":
                rotation = Rotation.from_rotvec(math.radians(self.rotation_angle or 0.0) * self._axis)
            case "theta":
                rotation = Rotation.from_rotvec(values[0] * self._axis)
            case "euler":
                rotation = Rotation.from_euler("ZYX", values)
            case "axis_angle":
                rotation = Rotation.from_rotvec(values)
            case _:
                if math.hypot(*values) < MIN_NORM:
                    raise WaypointError(
                        f"expected a quaternion that is not zero, got {', '.join(f'{value:g}' for value in values)}"
                    )
                return normalized(values)
        return normalized(rotation.as_quat().tolist())

    @property
    def _axis(self) -> NDArray[np.float64]:
        axis = np.array(self.rotation_vec or (0.0, 0.0, 1.0))
        return axis / np.linalg.norm(axis)

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> RotationConfig:
        if self.rotation_repr == "theta" or (self.rotation_repr == "none" and self.rotation_angle):
            if self.rotation_vec is None:
                raise KeyedError("rotation_vec", f"expected an axis for rotation_repr '{self.rotation_repr}', got none")
        if self.rotation_repr == "none":
            return self
        count, index = ROWS_OF[self.rotation_repr], tuple(self.rotation_vec_index or ())
        if not index or index not in ((index[0],) if count == 1 else (), (index[0], index[0] + count)):
            form = "[i]" if count == 1 else f"[i, i + {count}]"
            got = list(index) or "none"
            raise KeyedError("rotation_vec_index", f"expected {form} for '{self.rotation_repr}', got {got}")
        return self


class MotionDimensions(ConfigModel):
    """Meaning of the rows of the waypoint matrix: the pose of a frame, or the positions of joints."""

    number: Annotated[Count, Field(ge=1)] = Field(
        description="Number n of planned waypoint rows, without the row of times."
    )
    trans: TranslationConfig | None = optional("Position of a frame. Either this key or `joint_names` is required.")
    rotation: RotationConfig = Field(RotationConfig(), description="Orientation of a frame.")
    joint_names: ListOf[Text] | None = optional(
        "Names of n joints, in the order of the rows, if joints move instead of a frame."
    )

    @model_validator(mode="after")
    def _rows_exist(self) -> MotionDimensions:
        if (self.trans is None) == (self.joint_names is None):
            raise KeyedError("trans", "expected either trans or joint_names, one of them")
        if self.joint_names is not None:
            if len(self.joint_names) != self.number or len(set(self.joint_names)) != self.number:
                what = f"expected {self.number} names that differ, as many as number, got {len(self.joint_names)}"
                raise KeyedError("joint_names", what)
            return self
        assert self.trans is not None
        for axis in AXES:
            constant, row = self.trans.axis(axis)
            if constant is None and (row is None or row >= self.number):
                key = f"trans.translation_{axis}_index"
                got = "none" if row is None else row
                raise KeyedError(key, f"expected a row below number, {self.number}, for a planned axis, got {got}")
        if self.rotation.rows and self.rotation.rows[-1] >= self.number:
            rows = list(self.rotation.rotation_vec_index or ())
            raise KeyedError("rotation.rotation_vec_index", f"expected rows below number, {self.number}, got {rows}")
        return self

    @property
    def scalar_rows(self) -> tuple[int, ...]:
        """Indices of the rows that are interpolated one by one as numbers."""
        path = self.rotation.rows if self.rotation.is_path else ()
        return tuple(row for row in range(self.number) if row not in path)

    def pose(self, scalars: Sequence[float], quat_xyzw: Quaternion | None) -> Pose:
        """Returns the frame's pose.

        Args:
            scalars: Values of the rows `scalar_rows`.
            quat_xyzw: Interpolated orientation; None to compute the orientation from `scalars` or the configuration.
        """
        assert self.trans is not None
        values = dict(zip(self.scalar_rows, scalars))
        axes = (self.trans.axis(axis) for axis in AXES)
        x, y, z = (constant if constant is not None else values[row or 0] for constant, row in axes)
        if quat_xyzw is None:
            quat_xyzw = self.rotation.quat([values[row] for row in self.rotation.rows])
        return Pose((x, y, z), quat_xyzw)


class InterpolationConfig(ConfigModel):
    """Settings of the interpolation between waypoints: curve, sample time, limits, and treatment of new waypoints."""

    use_interpolation: Switch = Field(
        True,
        description="Whether targets are interpolated; otherwise the waypoints are published unchanged, at their "
        "times.",
    )
    inter_dt: Seconds = Field(0.01, description="Time between two interpolated samples.")
    nochange_window_length: Count = Field(0, description="Number of next samples that new waypoints do not change.")
    method: Literal["linear", "cubic", "quintic"] = Field(
        "cubic", description="Shape of the curve between two waypoints."
    )
    time_origin: Literal["arrival", "ros_time"] = Field(
        "arrival", description="Time 0 of the waypoints: the arrival of their message, or 0 of ROS time."
    )
    limits: MotionLimitsConfig = Field(MotionLimitsConfig(), description="Limits of speeds and accelerations.")
    hold: Switch = Field(False, description="Whether the last target is published repeatedly after the last waypoint.")
    accept_repetitions: Switch = Field(
        False, description="Whether a message that equals the previous one is a new motion, otherwise a repetition."
    )


class PublisherConfig(ConfigModel):
    """TF frames or joint topic to which the interpolated targets are published."""

    header_frame_id: FrameId | None = optional("Parent frame of the target; required if a frame moves.")
    msg_child_frame_id: FrameId | None = optional("TF frame that is the target; required if a frame moves.")
    joint_topic: TopicName = Field("joint_states/target", description="Topic of the joint targets, if joints move.")


class CommunicationConfig(ConfigModel):
    """Topics and TF frames of `interpolation_node.py`."""

    publisher: PublisherConfig = Field(PublisherConfig(), description="Topic or TF frames of the targets.")


class WaypointMotionConfig(ConfigModel):
    """A motion through waypoints: meaning of the waypoints, interpolation, and destination of the targets."""

    motion_dimensions: MotionDimensions = Field(description="Meaning of the waypoint rows.")
    interpolation: InterpolationConfig = Field(InterpolationConfig(), description="Interpolation between waypoints.")
    communication: CommunicationConfig = Field(CommunicationConfig(), description="Topics and TF frames.")

    @model_validator(mode="after")
    def _has_frames(self) -> WaypointMotionConfig:
        publisher = self.communication.publisher
        if self.motion_dimensions.joint_names is None:
            for key in ("header_frame_id", "msg_child_frame_id"):
                if getattr(publisher, key) is None:
                    raise KeyedError(f"communication.publisher.{key}", "expected a TF frame, got none")
        self.interpolation.limits.check_rows(len(self.motion_dimensions.scalar_rows), self.interpolation.method)
        return self
