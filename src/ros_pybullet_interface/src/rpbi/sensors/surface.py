"""The surface of a soft body."""

import math

from custom_ros_tools.errors import PhysicsError
from rpbi.samples import SurfaceSample

from .sensor import SensedBody, Sensor


class SurfaceSensor(Sensor):
    """Measures the corners of the triangles of a soft body's surface."""

    sample_type = SurfaceSample
    ros_topic = "rpbi.ros.publishers.sample_topics:SURFACE"

    def __init__(self, body: SensedBody, hz: float) -> None:
        super().__init__(body.name, hz)
        self._body = body
        self._rgba = body.pb.getVisualShapeData(body.body_id)[0][7]

    def read(self, tick: int) -> SurfaceSample:
        """Reads the positions [m] of the corners in the world frame, three corners for each triangle."""
        _, corners = self._body.pb.getMeshData(self._body.body_id, -1)
        if not math.isfinite(sum(map(sum, corners))):
            raise PhysicsError(f"{self.name}: surface is not finite any more at tick {tick}")
        return SurfaceSample(self.name, corners, self._rgba)
