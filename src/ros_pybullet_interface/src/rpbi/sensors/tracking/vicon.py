"""Poses of links, as a Vicon motion capture system reports them."""

from __future__ import annotations

import math
from typing import Any

from custom_ros_tools.errors import ConfigError, PhysicsError, Problem, UnknownNameError
from custom_ros_tools.schema import Text, optional
from rpbi.geometry import Pose
from rpbi.samples import ViconSample
from rpbi.sensors.link_pose import index_of_link
from rpbi.sensors.sensor import BodySensor, SensedWorld

from .imperfections import Delay, Occlusion, PoseNoise, TrackingSensorConfig


class ViconConfig(TrackingSensorConfig):
    """A Vicon segment (a rigid part with markers); the Vicon subject is the body that lists this sensor."""

    link: Text | None = optional("Link that is reported as the segment. By default, the root link.")


class ViconSensor(BodySensor):
    """Measures a link's pose in the world frame as motion capture does, without samples during occlusions.

    Attributes:
        tf_frames: The name of the TF frame whose pose is reported, as a tuple of one element.

    Raises:
        ConfigError: If the body has no such link.
    """

    Config = ViconConfig
    sample_type = ViconSample
    ros_topic = "rpbi.ros.publishers.sample_topics:VICON"

    def __init__(self, body: Any, config: ViconConfig) -> None:
        super().__init__(body, config)
        self._index = index_of_link(body, config.link)
        if self._index is None:
            links = [body.link_name(index) for index in (-1, *body.link_indices)]
            message = str(UnknownNameError("link", str(config.link), links))
            raise ConfigError([Problem(body.name, f"sensors.{config.name}.link", message)])
        self.tf_frames = (f"vicon/{self.name}",)
        self._noise = PoseNoise(config, config.seed_of(self.name))

    def enter(self, world: SensedWorld) -> None:
        """Prepares occlusion and latency, which depend on the length of the world's ticks."""
        config, dt_ns = self.config, world.clock.dt_ns
        self._dt_ns = dt_ns
        self._occlusion = Occlusion(config.occlusion, config.seed_of(self.name), dt_ns * 1e-9)
        self._delay: Delay[Pose | None] = Delay(math.ceil(config.latency_s * 1e9 / dt_ns - 1e-6))

    def read(self, tick: int) -> ViconSample | None:
        """Measures the pose, and returns the measurement that was made `latency_s` ago.

        Returns None if the link was occluded at that time, or if measurements are not old enough.
        """
        self._delay.push(tick, None if self._occlusion.hides(tick) else self._noise.on(self._pose(tick), tick))
        newest = self._delay.newest(tick)
        seen_at, pose = newest or (tick, None)
        if pose is None:
            return None
        return ViconSample(self.name, self.tf_frames[0], pose, (tick - seen_at) * self._dt_ns)

    def _pose(self, tick: int) -> Pose:
        pose: Pose = self.body.base_pose() if self._index == -1 else self.body.link_pose(self._index)
        if not math.isfinite(sum(pose.position)):
            raise PhysicsError(f"{self.name}: pose is not finite any more at tick {tick}: {pose.position}")
        return pose
