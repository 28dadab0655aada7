"""Bodies as Vicon reports them."""

from __future__ import annotations

import math
from typing import Any

from custom_ros_tools.errors import PhysicsError
from rpbi.geometry import Pose
from rpbi.samples import ViconSample
from rpbi.sensors.sensor import BodySensor, SensedWorld

from .imperfections import Delay, Occlusion, PoseNoise, TrackingConfig


class ViconSensor(BodySensor):
    """Pose of a body's root link in the world, as a motion capture system sees it; while it is hidden, nothing.

    Attributes:
        frames: The TF frame that is reported.
    """

    Config = TrackingConfig
    sample_type = ViconSample
    ros_topic = "rpbi.ros.publishers.tracking:VICON"

    def __init__(self, body: Any, config: TrackingConfig) -> None:
        super().__init__(body, config)
        self.frames = (f"vicon/{self.name}",)
        self._noise = PoseNoise(config, config.seed_of(self.name))

    def enter(self, world: SensedWorld) -> None:
        """Gets to know the length of a tick."""
        config, dt_ns = self.config, world.clock.dt_ns
        self._dt_ns = dt_ns
        self._occlusion = Occlusion(config.occlusion, config.seed_of(self.name), dt_ns * 1e-9)
        self._delay: Delay[Pose | None] = Delay(math.ceil(config.latency_s * 1e9 / dt_ns - 1e-6))

    def read(self, tick: int) -> ViconSample | None:
        """Measures the body, and returns what was measured long enough ago; None if it was hidden then."""
        self._delay.take(tick, None if self._occlusion.hides(tick) else self._noise.on(self._pose(tick), tick))
        newest = self._delay.newest(tick)
        seen_at, pose = newest or (tick, None)
        if pose is None:
            return None
        return ViconSample(self.name, self.frames[0], pose, (tick - seen_at) * self._dt_ns)

    def _pose(self, tick: int) -> Pose:
        pose: Pose = self.body.base_pose()
        if not math.isfinite(sum(pose.position)):
            raise PhysicsError(f"{self.name}: pose is not finite any more at tick {tick}: {pose.position}")
        return pose
