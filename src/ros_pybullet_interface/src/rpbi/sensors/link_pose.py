"""Poses of a body and its links."""

import math

from custom_ros_tools.errors import PhysicsError
from rpbi.geometry import Pose
from rpbi.samples import LinkPoseSample

from .sensor import SensedBody, Sensor


def index_of_link(body: SensedBody, link: str | None) -> int | None:
    """Returns PyBullet's index of a link.

    Args:
        link: Name of the link; None for the root link, whose index is -1.

    Returns:
        The index; None if the body has no such link.
    """
    return -1 if link is None else next((i for i in (-1, *body.link_indices) if body.link_name(i) == link), None)


class LinkPoseSensor(Sensor):
    """Measures the poses of a body's links (their URDF frames) in the world frame.

    Args:
        links: Whether to report all links, with TF frames `rpbi/NAME/LINK`; if not, only the root link is reported.
        root_frame: TF frame of the root link; by default `rpbi/NAME/LINK`, as for the other links.

    Attributes:
        tf_frames: TF frames of the links, without prefix; the root link's frame comes first.
    """

    sample_type = LinkPoseSample
    keeps_state = False
    ros_topic = None

    def __init__(self, body: SensedBody, hz: float, links: bool = True, root_frame: str | None = None) -> None:
        super().__init__(body.name, hz)
        self._body = body
        self._indices = body.link_indices if links else ()
        self.root_frame = root_frame or f"rpbi/{body.name}/{body.root_link}"
        self.tf_frames = (self.root_frame, *(f"rpbi/{body.name}/{body.link_name(index)}" for index in self._indices))

    def read(self, tick: int) -> LinkPoseSample:
        """Reads the poses of the root link and, if configured, of all other links."""
        pb, body_id = self._body.pb, self._body.body_id
        base = self._body.base_pose()
        if not math.isfinite(sum(base.position)):
            raise PhysicsError(f"{self.name}: pose is not finite any more at tick {tick}: {base.position}")
        if not self._indices:
            return LinkPoseSample(self.name, self.tf_frames, (base,))
        states = pb.getLinkStates(body_id, self._indices, computeForwardKinematics=1)
        return LinkPoseSample(self.name, self.tf_frames, (base, *(Pose(state[4], state[5]) for state in states)))
