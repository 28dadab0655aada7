"""Poses of a body and its links."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from custom_ros_tools.errors import PhysicsError

from ..pose import Pose
from ..samples import LinkPoseSample
from .sensor import Sensor

if TYPE_CHECKING:
    from ..bodies.body import Body


class LinkPoseSensor(Sensor):
    """Poses of the URDF frames of a body's links in the world.

    Args:
        body: The body.
        hz: Rate [Hz].
        links: Whether to tell every link as `rpbi/NAME/LINK`; otherwise only the body as `rpbi/NAME`.
    """

    def __init__(self, body: Body, hz: float, links: bool = True) -> None:
        super().__init__(body.name, hz)
        self._body = body
        frame = f"rpbi/{body.name}"
        self._indices = body.joint_indices if links else ()
        if links:
            root: bytes = body.pb.getBodyInfo(body.body_id)[0]
            names = [root, *(body.pb.getJointInfo(body.body_id, index)[12] for index in self._indices)]
            self._frames = tuple(f"{frame}/{name.decode()}" for name in names)
        else:
            self._frames = (frame,)

    def read(self, tick: int) -> LinkPoseSample:
        """Reads the base and all links."""
        pb, body_id = self._body.pb, self._body.body_id
        base = self._body.base_pose()
        if not math.isfinite(sum(base.position)):
            raise PhysicsError(f"{self.name}: pose is not finite any more at tick {tick}: {base.position}")
        if not self._indices:
            return LinkPoseSample(self.name, self._frames, (base,))
        states = pb.getLinkStates(body_id, self._indices, computeForwardKinematics=1)
        return LinkPoseSample(self.name, self._frames, (base, *(Pose(state[4], state[5]) for state in states)))
