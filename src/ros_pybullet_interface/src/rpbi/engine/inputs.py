"""Inputs of bodies and sensors: values that other threads send while the world runs."""

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
    """An input of a body or sensor, such as the target positions of a robot.

    Attributes:
        check: Function that converts a received value for `apply`. Runs in the receiving thread and must not call
            PyBullet. Raises ValueError or an InterfaceError to refuse the value.
        apply: Function that applies the newest value. Runs on the simulation thread before the next tick.
        merge: Function that combines a waiting value with a newer value. None: newer values replace waiting ones.
        ros_topic: Import path `module:NAME` of the input's Topic, for an input from another package.
        owner: Text for `{name}` in the topic's name; if empty, the name of the body or sensor.
    """

    check: Callable[[Any], Any]
    apply: Callable[[Any], None]
    merge: Callable[[Any, Any], Any] | None = None
    ros_topic: str = ""
    owner: str = ""


@dataclass(frozen=True, kw_only=True)
class PoseInput(Input):
    """An input whose values are the poses of a TF frame in the world frame.

    Attributes:
        tf_id: Name of the TF frame.
        hz: Rate [Hz] of TF look-ups, in wall time.
        timeout_s: Time [s] without a new pose after which the input is stale.
        is_tracked: Whether physics moves the body while the input is stale. If so, an unchanged pose with a new stamp
            counts as a new pose.
    """

    tf_id: str
    hz: float
    timeout_s: float
    is_tracked: bool = False

    @classmethod
    def following(cls, object_tf: ObjectTf, apply: Callable[[Pose], None], is_tracked: bool = False) -> PoseInput:
        """Creates the input for the frame that YAML configures under `object_tf`.

        Args:
            object_tf: Configuration of the frame.
            apply: Function that applies a pose, see `Input.apply`.
            is_tracked: See `PoseInput.is_tracked`.
        """
        tf = object_tf
        return cls(check_pose, apply, tf_id=tf.tf_id, hz=tf.hz, timeout_s=tf.timeout_s, is_tracked=is_tracked)


def check_pose(given: geometry.Pose | Mapping[str, Any]) -> Pose:
    """Checks a pose, or converts a mapping of its fields, and returns the pose with a normalized quaternion.

    Raises:
        ValueError: If `given` is not a pose, a number is not finite or too large, or the quaternion is zero.
    """
    position, quat = as_tuple(Pose, given)
    if not all(map(math.isfinite, (*position, *quat))):
        raise ValueError(f"pose must be finite, got {position}, {quat}")
    if max(map(abs, position)) > MAX_COORDINATE_M:
        raise ValueError(f"position must be within +-{MAX_COORDINATE_M:g} m, got {position}")
    if math.hypot(*quat) < 1e-6:
        raise ValueError(f"quaternion must not be zero, got {quat}")
    return Pose((position[0], position[1], position[2]), normalized(quat))
