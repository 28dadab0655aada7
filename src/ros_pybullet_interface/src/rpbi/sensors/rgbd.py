"""RGB-D cameras, as far as the world is concerned: what they see, not how it looks."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import TYPE_CHECKING

from ..clock import Clock
from ..inputs import Input, PoseInput
from ..pose import Pose
from ..rgbd_config import RgbdSensorConfig
from ..samples import SceneSample
from .sensor import Sensor

if TYPE_CHECKING:
    from ..bodies.body import Body

log = logging.getLogger(__name__)

PLANNED = ("pointcloud", "synchronous")
"""Keys that are accepted and do nothing yet."""


class RgbdSensor(Sensor):
    """Collects the scene for the renderer while somebody looks at the camera's images.

    Args:
        config: Its part of the main YAML file.
        bodies: The world's bodies by name.
        clock: The world's clock.
    """

    Config = RgbdSensorConfig
    sample_type = SceneSample

    def __init__(self, config: RgbdSensorConfig, bodies: Mapping[str, Body], clock: Clock) -> None:
        super().__init__(config.name, config.hz)
        for key in PLANNED:
            if getattr(config, key):
                log.warning("rgbd_sensor: %s: has no effect yet", key)
        self.config = config
        self.wanted = False
        self._bodies = bodies
        self._clock = clock
        self._pose: Pose | None = None

    def inputs(self) -> Mapping[str, Input]:
        """Takes `pose`, the pose of the optical frame in the world."""
        return {"pose": PoseInput.following(self.config.object_tf, self._set_pose)}

    def read(self, tick: int) -> SceneSample | None:
        """Returns where everything is, None as long as the camera's own pose is unknown."""
        if self._pose is None:
            return None
        bodies = tuple(body.state() for body in self._bodies.values())
        return SceneSample(self.name, tick, self._clock.stamp_ns, self._pose, bodies)

    def _set_pose(self, pose: Pose) -> None:
        self._pose = pose
