"""Simulated RGB-D cameras. Their samples are scenes, from which the renderer process draws images."""

from collections.abc import Mapping

from rpbi.config.sensors import RgbdSensorConfig
from rpbi.engine.clock import Clock
from rpbi.engine.inputs import Input, PoseInput
from rpbi.geometry import Pose
from rpbi.samples import SceneSample

from .sensor import SensedBody, Sensor


class RgbdSensor(Sensor):
    """Collects the scene for the renderer while the camera's images have viewers.

    A scene consists of the camera's pose and the states of all bodies.

    Attributes:
        topic_name: Name of the camera in topics.
        pose: Pose of the camera's optical frame in the world frame; None while the pose is unknown.
    """

    Config = RgbdSensorConfig
    sample_type = SceneSample
    keeps_state = False
    ros_topic = None

    def __init__(
        self, config: RgbdSensorConfig, bodies: Mapping[str, SensedBody], clock: Clock, topic_name: str
    ) -> None:
        super().__init__(config.name, config.hz)
        self.config = config
        self.topic_name = topic_name
        self.wanted = False
        self.pose: Pose | None = None
        self._bodies = bodies
        self._clock = clock

    def inputs(self) -> Mapping[str, Input]:
        """Returns the only input `pose`, which sets the pose of the camera's optical frame in the world frame."""
        return {"pose": PoseInput.following(self.config.object_tf, self._set_pose)}

    def read(self, tick: int) -> SceneSample | None:
        """Returns the states of all bodies and the camera's pose; None while the camera's pose is unknown."""
        if self.pose is None:
            return None
        bodies = tuple(body.state() for body in self._bodies.values())
        return SceneSample(self.name, tick, self._clock.stamp_ns, self.pose, bodies)

    def _set_pose(self, pose: Pose) -> None:
        self.pose = pose
