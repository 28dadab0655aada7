"""What bodies and sensors take from outside while the world runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from custom_ros_tools.schema import FARTHEST_M
from rpbi.config.pybullet_models import ObjectTf
from rpbi.geometry import Pose, normalized
from rpbi.plain_values import as_tuple


@dataclass(frozen=True)
class Input:
    """Something that a body or sensor takes from outside.

    Attributes:
        check: Turns what came into what `apply` takes, in the thread it came in; it touches no PyBullet.
            It raises ValueError or an InterfaceError for what must be refused.
        apply: Acts on the newest value, on the simulation thread, before the tick.
        merge: Joins a value that still waits with a newer one; without it the newer one replaces it.
        ros_topic: Where to find the topic of an input from another package, a Topic, as `module:NAME`.
        owner: What stands for `{name}` in the topic's name; the body or sensor if it is empty.
    """

    check: Callable[[Any], Any]
    apply: Callable[[Any], None]
    merge: Callable[[Any, Any], Any] | None = None
    ros_topic: str = ""
    owner: str = ""


@dataclass(frozen=True, kw_only=True)
class PoseInput(Input):
    """A pose in the world that follows a TF frame.

    Attributes:
        tf_id: The frame to follow.
        hz: How often to look [Hz], in wall time.
        timeout_s: Without anything new for so long, it is stale [s].
        is_tracked: Whether physics moves the body while it is stale; then a new stamp with the same pose is news too.
    """

    tf_id: str
    hz: float
    timeout_s: float
    is_tracked: bool = False

    @classmethod
    def following(cls, object_tf: ObjectTf, apply: Callable[[Pose], None], is_tracked: bool = False) -> PoseInput:
        """Follows the frame that YAML names under `object_tf`."""
        tf = object_tf
        return cls(check_pose, apply, tf_id=tf.tf_id, hz=tf.hz, timeout_s=tf.timeout_s, is_tracked=is_tracked)


def check_pose(given: Pose | Mapping[str, Any]) -> Pose:
    """Returns a pose, or that of a mapping of its fields, with its quaternion normalised.

    Raises:
        ValueError: If it is none, a number is not finite or the quaternion is zero.
    """
    position, quat = as_tuple(Pose, given)
    if not all(map(math.isfinite, (*position, *quat))):
        raise ValueError(f"pose must be finite, got {position}, {quat}")
    if max(map(abs, position)) > FARTHEST_M:
        raise ValueError(f"position must be within +-{FARTHEST_M:g} m, got {position}")
    if math.hypot(*quat) < 1e-6:
        raise ValueError(f"quaternion must not be zero, got {quat}")
    return Pose((position[0], position[1], position[2]), normalized(quat))
