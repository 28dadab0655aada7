"""Whether all numbers are finite that PyBullet has made of a body."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import chain

from custom_ros_tools.errors import PhysicsError

from .bodies import Body


def refuse_non_finite(body: Body) -> None:
    """Refuses a rigid body with numbers that are not finite, which would spread to all that it touches.

    They come from URDFs with `nan` in them, which PyBullet loads without a word, and from sizes that are too large.

    Raises:
        PhysicsError: If there is one; it names the link.
    """
    for fault in _faults(body):
        raise PhysicsError(f"{body.name}: {fault} not finite: is something nan, inf or too large?")


def _faults(body: Body) -> Iterator[str]:
    pb, body_id = body.pb, body.body_id
    links = {index: f"link '{body.link_name(index)}'" for index in (-1, *body.joint_indices)}
    for index, link in links.items():
        mass, _, inertia, position, quat = pb.getDynamicsInfo(body_id, index)[:5]
        if not _are_finite((mass, *inertia, *position, *quat)):
            yield f"{link}: its mass, inertia or centre of mass is"
    for index in body.joint_indices:
        info = pb.getJointInfo(body_id, index)
        joint = f"joint '{info[1].decode()}'"
        if not _are_finite((*info[6:8], *info[13], *info[14], *info[15])):
            yield f"{joint}: its place, axis, damping or friction is"
        if any(map(math.isnan, info[8:12])):  # a limit may be infinite
            yield f"{joint}: one of its limits is"
    for index, link in links.items():
        if not _are_finite(chain(*pb.getAABB(body_id, index))):
            yield f"{link}: its place or size is"


def _are_finite(numbers: Iterable[float]) -> bool:
    return all(map(math.isfinite, numbers))
