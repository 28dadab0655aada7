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

    name: FrameId = Field(description="TF frame of the object that is broadcast.")
    vicon: Text | None = optional("Subject and segment, as `SUBJECT/SEGMENT`; the topic is `vicon/SUBJECT/SEGMENT`.")
    april_tag: Count | ListOf[Count] | None = optional("Id of a tag, or a list: those of a bundle.")
    topics: ListOf[TopicName] = Field(
        ("tag_detections",), description="Topics of the detectors that see its tags, one for each camera."
    )
    frame_id: FrameId | None = optional("TF frame of its poses; without it, the frame in the messages.")
    unit: Literal["m", "mm"] = Field("m", description="Unit of the received positions.")
    position: Position = Field((0.0, 0.0, 0.0), description="Position of the object's frame in the tracked frame.")
    orientation: Quat = Field((0.0, 0.0, 0.0, 1.0), description="Its orientation, x, y, z, w.")

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
        0.5, description="Time without a pose after which an object is lost: nothing is broadcast."
    )
    smoothing: SmoothingConfig = Field(SmoothingConfig(), description="Smoothing of poses.")
    outliers: OutlierConfig = Field(OutlierConfig(), description="Rejection of outliers.")
    objects: ListOf[TrackedObjectConfig] = Field(description="The objects.")

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

    id: Count = Field(description="Its number in the family.")
    size: PositiveMetres = Field(description="Side of its black square.")
    name: FrameId | None = optional("Its TF frame; without it, `tag_ID`.")


class AprilTagNodeConfig(ConfigModel):
    """Tags of the family tag36h11 that `apriltag_node.py` reports."""

    standalone_tags: ListOf[StandaloneTag] = Field(description="The tags.")
    publish_tf: Switch = Field(True, description="Whether their poses are on TF too.")

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
