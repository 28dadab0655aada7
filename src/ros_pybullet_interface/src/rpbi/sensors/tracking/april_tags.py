"""AprilTag detections, computed from the world instead of a camera's images."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import Field, model_validator

from custom_ros_tools.schema import (
    ConfigModel,
    Count,
    Degrees,
    KeyedError,
    ListOf,
    Name,
    Position,
    PositiveMetres,
    Quat,
    Text,
    TopicName,
    optional,
)
from robot_model.geometry import Vector, dot, plus
from rpbi.geometry import Pose, rotated
from rpbi.samples import AprilTagsSample, SeenTag
from rpbi.sensors.link_pose import index_of_link
from rpbi.sensors.rgbd import RgbdSensor
from rpbi.sensors.sensor import BodySensor, SensedWorld

from .imperfections import Delay, Occlusion, PoseNoise, TrackingSensorConfig

log = logging.getLogger(__name__)

SURFACE_M = 0.005
"""Largest depth [m] of a visible tag below a body's surface; deeper ones are hidden."""


class TagConfig(ConfigModel):
    """A tag on a body; the tag's frame has x to the right, y up and z towards the viewer."""

    id: Count = Field(description="Number of the tag in its tag family.")
    size: PositiveMetres = Field(description="Side of the tag's black square.")
    body: Name | None = optional("Body that carries the tag. By default, the body with the sensor.")
    link: Text | None = optional("Link that carries the tag. By default, the root link.")
    position: Position = Field((0.0, 0.0, 0.0), description="Position of the tag's centre in the link's frame.")
    orientation: Quat = Field(
        (0.0, 0.0, 0.0, 1.0), description="Orientation of the tag in the link's frame, x, y, z, w."
    )

    @property
    def pose(self) -> Pose:
        """Pose of the tag in the frame of its link."""
        return Pose(self.position, self.orientation)


class AprilTagsConfig(TrackingSensorConfig):
    """A detector of AprilTags: its camera and its tags."""

    camera: Name = Field(
        description="RGB-D camera of the world that sees the tags; subscribers to its images are not necessary."
    )
    topic: TopicName = Field(
        "tag_detections", description="Topic of the detections; each detector needs its own topic."
    )
    tags: ListOf[TagConfig] = Field(description="Tags that are reported.")
    max_angle_deg: Annotated[Degrees, Field(gt=0, lt=90)] = Field(
        75.0, description="Largest angle between a tag's normal and the line of sight at which the tag is seen."
    )
    min_side_px: Annotated[float, Field(ge=0)] = Field(
        12.0,
        description="Least side of the black square in the image at which a tag is seen [px].",
    )

    @model_validator(mode="after")
    def _ids_differ(self) -> AprilTagsConfig:
        if not self.tags:
            raise KeyedError("tags", "expected at least one tag")
        ids = [tag.id for tag in self.tags]
        for index, one in enumerate(ids):
            if one in ids[:index]:
                raise KeyedError(f"tags[{index}].id", f"{one} is the id of another tag of this list")
        return self


class AprilTagsSensor(BodySensor):
    """Measures the poses of the tags that a camera sees, in the camera's optical frame.

    A tag is seen if it faces the camera, its whole square is in the image and large enough, and no collision shape
    covers it. In addition, `occlusion` can hide tags at random.
    """

    Config = AprilTagsConfig
    sample_type = AprilTagsSample
    ros_topic = "rpbi.ros.publishers.sample_topics:APRIL_TAGS"

    def __init__(self, body: Any, config: AprilTagsConfig) -> None:
        super().__init__(body, config)
        self.topic = config.topic
        self._missing: set[str] = set()

    def enter(self, world: SensedWorld) -> None:
        """Stores the world, and prepares noise, occlusion and latency."""
        config, dt_ns = self.config, world.clock.dt_ns
        self._world, self._dt_ns = world, dt_ns
        seeds = {tag.id: config.seed_of(f"{self.name}/{tag.id}") + tag.id for tag in config.tags}
        self._noise = {tag: PoseNoise(config, seed) for tag, seed in seeds.items()}
        self._occlusion = {tag: Occlusion(config.occlusion, seed, dt_ns * 1e-9) for tag, seed in seeds.items()}
        self._delay: Delay[tuple[SeenTag, ...]] = Delay(math.ceil(config.latency_s * 1e9 / dt_ns - 1e-6))

    def read(self, tick: int) -> AprilTagsSample | None:
        """Detects tags, and returns the detections that were made `latency_s` ago.

        Returns None while the camera or its pose is missing, or if detections are not old enough.
        """
        camera = self._world.cameras.get(self.config.camera)
        if camera is None:
            known = ", ".join(self._world.cameras) or "none"
            self._warn_once(self.config.camera, f"no camera '{self.config.camera}'; there is {known}")
        if camera is None or camera.pose is None:
            return None
        self._delay.push(tick, tuple(self._seen_by(camera, camera.pose, tick)))
        newest = self._delay.newest(tick)
        if newest is None:
            return None
        frame = camera.config.object_tf.tf_id
        return AprilTagsSample(self.name, frame, newest[1], (tick - newest[0]) * self._dt_ns)

    def _seen_by(self, camera: RgbdSensor, eye: Pose, tick: int) -> Iterator[SeenTag]:
        for tag in self.config.tags:
            placed = self._pose_of(tag)
            if placed is None or self._occlusion[tag.id].hides(tick):
                continue
            pose, body_id = placed
            in_camera = eye.inverse() @ pose
            if self._is_in_image(in_camera, tag.size, camera) and self._is_uncovered(pose, tag.size, eye, body_id):
                yield SeenTag(tag.id, tag.size, self._noise[tag.id].on(in_camera, tick))

    def _pose_of(self, tag: TagConfig) -> tuple[Pose, int] | None:
        """Returns a tag's pose in the world frame and its body's PyBullet id; None if body or link do not exist."""
        body = self.body if tag.body is None else self._world.bodies.get(tag.body)
        if body is None:
            self._warn_once(str(tag.body), f"no body '{tag.body}' for tag {tag.id}; it is not seen")
            return None
        index = index_of_link(body, tag.link)
        if index is None:
            self._warn_once(f"{body.name}/{tag.link}", f"no link '{tag.link}' in '{body.name}' for tag {tag.id}")
            return None
        return body.link_pose(index) @ tag.pose, body.body_id

    def _warn_once(self, what: str, message: str) -> None:
        if what not in self._missing:
            self._missing.add(what)
            log.warning("%s: %s", self.name, message)

    def _is_in_image(self, pose: Pose, size: float, camera: RgbdSensor) -> bool:
        normal = rotated(pose.quat_xyzw, (0.0, 0.0, 1.0))
        distance = math.hypot(*pose.position)
        if -dot(normal, pose.position) <= distance * math.cos(math.radians(self.config.max_angle_deg)):
            return False
        view = camera.config.intrinsics
        focal_px = view.height / 2.0 / math.tan(math.radians(view.fov) / 2.0)
        pixels = []
        for x, y, z in _corners(pose, size):
            if z < view.range[0]:
                return False
            pixels.append((focal_px * x / z, focal_px * y / z))
        if any(abs(x) > view.width / 2.0 or abs(y) > view.height / 2.0 for x, y in pixels):
            return False
        sides = (math.dist(one, pixels[index - 1]) for index, one in enumerate(pixels))
        return min(sides) >= self.config.min_side_px

    def _is_uncovered(self, pose: Pose, size: float, eye: Pose, body_id: int) -> bool:
        corners = _corners(pose, size)
        for hit, corner in zip(self._world.pb.rayTestBatch([eye.position] * len(corners), corners), corners):
            is_there = hit[0] == body_id and math.dist(hit[3], corner) < SURFACE_M
            if hit[0] >= 0 and not is_there and math.dist(hit[3], corner) > 1e-6:
                return False
        return True


def _corners(pose: Pose, size: float) -> list[Vector]:
    half = size / 2.0
    square: tuple[Vector, ...] = ((-half, -half, 0.0), (half, -half, 0.0), (half, half, 0.0), (-half, half, 0.0))
    return [plus(pose.position, rotated(pose.quat_xyzw, corner)) for corner in square]
