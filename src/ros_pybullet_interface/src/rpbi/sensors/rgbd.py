"""RGB-D cameras in the world: their poses and scenes, from which the renderer draws images."""

from collections.abc import Mapping

from rpbi.config.sensors import RgbdSensorConfig
from rpbi.engine.clock import Clock
from rpbi.engine.inputs import Input, PoseInput
from rpbi.geometry import Pose
from rpbi.samples import SceneSample

from .sensor import SensedBody, Sensor


class RgbdSensor(Sensor):
    """Collects the scene for the renderer while the camera's images have viewers.

    Attributes:
        topic_name: Its name in topics.
        pose: Pose of the optical frame in the world, None as long as it is unknown.
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
        """Returns `pose`, the pose of the optical frame in the world."""
        return {"pose": PoseInput.following(self.config.object_tf, self._set_pose)}

    def read(self, tick: int) -> SceneSample | None:
        """Returns the states of all bodies; None while the pose of the camera is unknown."""
        if self.pose is None:
            return None
        bodies = tuple(body.state() for body in self._bodies.values())
        return SceneSample(self.name, tick, self._clock.stamp_ns, self.pose, bodies)

    def _set_pose(self, pose: Pose) -> None:
        self.pose = pose
