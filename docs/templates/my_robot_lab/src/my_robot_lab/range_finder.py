"""A type of sensor: how far it is to the nearest thing in one direction."""

from typing import Annotated, NamedTuple

from pydantic import AfterValidator, Field

from custom_ros_tools.schema import Position, PositiveMetres, Vec3
from robot_model.geometry import Vector, plus, scaled
from rpbi.bodies import Body
from rpbi.geometry import Pose
from rpbi.sensors import BodySensor, SensorConfig


def _some_direction(direction: Vector) -> Vector:
    """Returns the direction; what raises ValueError is told with the file and the key."""
    if not any(direction):
        raise ValueError("a direction cannot be all zeros")
    return direction


class RangeFinderConfig(SensorConfig):
    """YAML of a range finder; `type`, `name` and `hz` every sensor has."""

    position: Position = Field((0.0, 0.0, 0.0), description="Where it is, in the frame of its body; outside of it.")
    direction: Annotated[Vec3, AfterValidator(_some_direction)] = Field(
        (1.0, 0.0, 0.0), description="Where it looks, in the frame of its body; of any length."
    )
    max_range: PositiveMetres = Field(description="How far it sees.")


class RangeSample(NamedTuple):
    """What it sees.

    Attributes:
        name: The sensor, as `BODY/NAME`.
        distance: How far it is to the nearest thing [m]; None if there is none in range.
        max_range: How far the sensor sees [m].
    """

    name: str
    distance: float | None
    max_range: float


class RangeFinder(BodySensor):
    """A beam from a place on its body."""

    Config = RangeFinderConfig
    sample_type = RangeSample
    ros_topic = "my_robot_lab.ros.topics:RANGE"

    def __init__(self, body: Body, config: RangeFinderConfig) -> None:
        super().__init__(body, config)
        length = sum(component**2 for component in config.direction) ** 0.5
        beam = scaled(config.max_range / length, config.direction)
        self._start = Pose(config.position)
        self._end = Pose(plus(config.position, beam))

    def read(self, tick: int) -> RangeSample:
        """Casts a ray."""
        pose = self.body.base_pose()
        ((body_id, _, fraction, _, _),) = self.body.pb.rayTest(
            (pose @ self._start).position, (pose @ self._end).position
        )
        max_range = self.config.max_range
        return RangeSample(self.name, None if body_id < 0 else fraction * max_range, max_range)
