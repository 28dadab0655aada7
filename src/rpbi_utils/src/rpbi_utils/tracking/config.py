"""Configuration of the tracking nodes."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from custom_ros_tools.schema import (
    ConfigModel,
    Count,
    FrameId,
    KeyedError,
    ListOf,
    Position,
    PositiveMetres,
    Quat,
    Seconds,
    Switch,
    Text,
    TopicName,
    optional,
)
from robot_model.geometry import Pose

from .tracker import OutlierConfig, SmoothingConfig

FAMILY_SIZE = 587
"""Number of tags in the family tag36h11."""


class TrackedObjectConfig(ConfigModel):
    """An object that is tracked either by Vicon or by AprilTags."""

    name: FrameId = Field(description="TF frame that is broadcast for the object.")
    vicon: Text | None = optional(
        "Vicon subject and segment of the object, as `SUBJECT/SEGMENT`; poses come from the topic "
        "`vicon/SUBJECT/SEGMENT`. Either this key or `april_tag` is required."
    )
    april_tag: Count | ListOf[Count] | None = optional(
        "Id of the object's tag, or a list with the ids of a bundle of tags. Either this key or `vicon` is required."
    )
    topics: ListOf[TopicName] = Field(
        ("tag_detections",), description="Topics of the detectors that see the object's tags, one for each camera."
    )
    frame_id: FrameId | None = optional("TF frame in which poses are received. By default, the frame in the messages.")
    unit: Literal["m", "mm"] = Field("m", description="Unit of the received positions.")
    position: Position = Field(
        (0.0, 0.0, 0.0), description="Position of the object's frame in the frame of the segment, tag or bundle."
    )
    orientation: Quat = Field(
        (0.0, 0.0, 0.0, 1.0),
        description="Orientation of the object's frame in the frame of the segment, tag or bundle, x, y, z, w.",
    )

    @model_validator(mode="after")
    def _one_source(self) -> TrackedObjectConfig:
        if (self.vicon is None) == (self.april_tag is None):
            raise KeyedError("vicon", "an object is seen by either vicon or april_tag, one of them")
        if self.vicon is not None and len([part for part in self.vicon.split("/") if part]) != 2:
            raise KeyedError("vicon", f"expected SUBJECT/SEGMENT, got '{self.vicon}'")
        if not self.topics or (self.vicon is not None and "topics" in self.model_fields_set):
            raise KeyedError("topics", "expected at least one, with april_tag only")
        return self

    @property
    def tag_ids(self) -> tuple[int, ...]:
        """Ids of the object's tags, sorted; empty if Vicon tracks the object."""
        if self.april_tag is None:
            return ()
        return (self.april_tag,) if isinstance(self.april_tag, int) else tuple(sorted(self.april_tag))

    @property
    def offset(self) -> Pose:
        """Pose of the object's frame in the frame of the Vicon segment, tag or tag bundle."""
        return Pose(self.position, self.orientation)


class TrackingNodeConfig(ConfigModel):
    """Objects that `tracked_object_node.py` tracks, and parameters for filtering and broadcasting their poses."""

    frame_id: FrameId = Field("rpbi/world", description="TF frame in which poses are smoothed and broadcast.")
    timeout_s: Seconds = Field(
        0.5, description="Time without a pose after which an object counts as lost, and is no longer broadcast."
    )
    smoothing: SmoothingConfig = Field(SmoothingConfig(), description="Smoothing of poses.")
    outliers: OutlierConfig = Field(OutlierConfig(), description="Rejection of outliers.")
    objects: ListOf[TrackedObjectConfig] = Field(description="Objects that are tracked.")

    @model_validator(mode="after")
    def _names_differ(self) -> TrackingNodeConfig:
        if not self.objects:
            raise KeyedError("objects", "expected at least one object")
        names = [each.name for each in self.objects]
        for index, name in enumerate(names):
            if name in names[:index]:
                raise KeyedError(f"objects[{index}].name", f"'{name}' is the name of another object")
        return self


class StandaloneTag(ConfigModel):
    """Id, size and TF frame of a tag that `apriltag_node.py` reports."""

    id: Count = Field(description="Number of the tag in its tag family.")
    size: PositiveMetres = Field(description="Side of the tag's black square.")
    name: FrameId | None = optional("TF frame of the tag. By default, `tag_ID`.")


class AprilTagNodeConfig(ConfigModel):
    """Tags of the family tag36h11 that `apriltag_node.py` reports."""

    standalone_tags: ListOf[StandaloneTag] = Field(description="Tags that are reported.")
    publish_tf: Switch = Field(True, description="Whether the poses of tags are also published on TF.")

    @model_validator(mode="after")
    def _ids_differ(self) -> AprilTagNodeConfig:
        if not self.standalone_tags:
            raise KeyedError("standalone_tags", "expected at least one tag")
        ids = [tag.id for tag in self.standalone_tags]
        for index, one in enumerate(ids):
            if one in ids[:index]:
                raise KeyedError(f"standalone_tags[{index}].id", f"{one} is the id of another tag")
            if one >= FAMILY_SIZE:
                raise KeyedError(f"standalone_tags[{index}].id", f"tag36h11 has ids below {FAMILY_SIZE}, got {one}")
        return self
