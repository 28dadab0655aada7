"""Questions about worlds and bodies that several warnings ask."""

from collections.abc import Sequence

import pybullet

from rpbi.bodies import Body
from rpbi.world import World

MAX_NAMES = 3
"""Bodies or links that a warning names; it counts the others."""


def file_of(world: World, name: str) -> str:
    """Returns the file of a body or camera."""
    files = {item.config.name: item.file for item in world.loaded.objects}
    return {**files, **{camera.config.name: camera.file for camera in world.loaded.cameras}}[name]


def some(names: Sequence[str]) -> str:
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return ", ".join(names[:MAX_NAMES]) + more


def is_still(body: Body, link: int) -> bool:
    """Returns whether a link is static: a fixed base, and all links fixed to it."""
    if body.is_soft:
        return False
    if not body.has_physics:
        return True
    while link >= 0:
        info = body.pb.getJointInfo(body.body_id, link)
        if info[2] != pybullet.JOINT_FIXED:
            return False
        link = info[16]
    load = getattr(getattr(body, "config", None), "loadURDF", None)
    return bool(load is not None and load.useFixedBase) or body.dynamics_info(-1)[0] == 0.0
