"""Inputs of bodies and sensors while the world runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from custom_ros_tools.schema import MAX_COORDINATE_M
from robot_model import geometry
from robot_model.geometry import normalized
from rpbi.config.pybullet_models import ObjectTf
from rpbi.geometry import Pose
from rpbi.plain_values import as_tuple


@dataclass(frozen=True)
class Input:
    """An input of a body or sensor.

    Attributes:
        check: Converts a received value for `apply`, in the receiving thread, without PyBullet. It raises ValueError or
            an InterfaceError to refuse the value.
        apply: Acts on the newest value, on the simulation thread, before the tick.
        merge: Combines a waiting value with a newer one; without it, the newer one replaces it.
        ros_topic: Place of the Topic of an input from another package, as `module:NAME`.
        owner: Value of `{name}` in the topic's name; the body or sensor if empty.
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
        hz: Rate of TF look-ups [Hz], in wall time.
        timeout_s: Time without a new pose after which it is stale [s].
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


def check_pose(given: geometry.Pose | Mapping[str, Any]) -> Pose:
    """Returns a pose, or that of a mapping of its fields, with its quaternion normalised.

    Raises:
        ValueError: If it is none, a number is not finite or the quaternion is zero.
    """
    position, quat = as_tuple(Pose, given)
    if not all(map(math.isfinite, (*position, *quat))):
        raise ValueError(f"pose must be finite, got {position}, {quat}")
    if max(map(abs, position)) > MAX_COORDINATE_M:
        raise ValueError(f"position must be within +-{MAX_COORDINATE_M:g} m, got {position}")
    if math.hypot(*quat) < 1e-6:
        raise ValueError(f"quaternion must not be zero, got {quat}")
    return Pose((position[0], position[1], position[2]), normalized(quat))
