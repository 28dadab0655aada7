"""Keys of older worlds that are still accepted: old spellings, and keys without effect."""

import copy
import logging
from collections.abc import Mapping
from typing import Any

from custom_ros_tools.errors import Problem

log = logging.getLogger(__name__)

MAIN = "main"
"""Section name of the main YAML file. The section of an object's file is the list that contains it, like `robots`."""

LEGACY_KEYS: dict[str, dict[str, str]] = {
    "robots": {
        "publish_joint_state_frequency": "joint_state_publisher_hz",
        "broadcast_link_states_frequency": "broadcast_link_states_hz",
        "brodcast_link_states_frequency": "broadcast_link_states_hz",
        "initial_joint_positions": "initial_joint_position",
        "setJointMotorControlArrayParameters": "setJointMotorControlArray",
    },
}
"""For each section, the present spellings of keys, indexed by the old spelling."""

FOLLOWERS = ("robots", "visual_objects", "collision_objects", "urdfs")
"""Lists of objects that may follow a TF frame; in their files, an `object_tf` without `tf_id` is ignored."""
_FOLLOW = "write tf_id with the name of a TF frame"
_OBJECT_TF = {
    "object_tf.base": _FOLLOW,
    "object_tf.base_tf_id": _FOLLOW,
    "object_tf.is_static": "publish a static TF frame",
    "object_tf.listener_frequency": "write hz",
    "object_tf.pose_reset_hz": "write hz",
    "object_tf.offset": "publish a TF frame with the offset in it",
    "object_tf.timeout": "write timeout_s",
    "object_tf.broadcast_tf": "the frame that it follows is on TF already",
    "object_tf.tf_frame_id": "the frame that it follows is on TF already",
}
"""Advice for keys that were used before `tf_id` existed; these keys have no effect."""

NO_EFFECT: dict[str, dict[str, str]] = {
    MAIN: {
        "gravity": "write setGravity: {gravZ: -9.81}",
        "visual_object": "write visual_objects with a list of files",
        "setPhysicsEngineParameter.fixedTimeStep": "write timeStep",
    },
    "robots": {
        **_OBJECT_TF,
        "self.broadcast_link_states_hz": "write broadcast_link_states_hz",
        "setJointMotorControlArray.forces": "efforts are limited by the URDF",
        "setJointMotorControlArray.targetPositions": "targets come by topic",
        "setJointMotorControlArray.targetVelocities": "targets come by topic",
    },
    **dict.fromkeys(FOLLOWERS[1:], _OBJECT_TF),
    "dynamic_objects": {"object_tf": "physics moves it; write basePosition and baseOrientation"},
}
"""For each section, advice for keys of older worlds that have no effect, indexed by key."""


def old_keys(section: str) -> dict[str, str]:
    """Returns advice on keys of older worlds, indexed by key. A nested key is written like `object_tf.offset`."""
    spellings = {old: f"Old spelling: write {new}." for old, new in LEGACY_KEYS.get(section, {}).items()}
    return {**spellings, **{key: f"No effect: {advice}." for key, advice in NO_EFFECT.get(section, {}).items()}}


def modernise(section: str, data: Mapping[str, Any], file: str) -> tuple[dict[str, Any], dict[str, str], list[Problem]]:
    """Replaces old spellings of keys, removes keys without effect, and logs a warning for each such key.

    Args:
        section: `"main"` for the main file; for an object's file, the main file's key under which that file is listed.
        data: Content of the file; it is not changed.
        file: Name of the file, for messages.

    Returns:
        A copy of `data` with present spellings; the old spellings in `data`, indexed by present spelling; and a problem
        for each key that `data` contains in two spellings.
    """
    current = copy.deepcopy(dict(data))
    spellings: dict[str, str] = {}
    problems: list[Problem] = []
    for old, new in LEGACY_KEYS.get(section, {}).items():
        if old not in current:
            continue
        value = current.pop(old)
        if new in current:
            problems.append(Problem(file, old, f"means {spellings.get(new, new)}, which is given too: remove one"))
            continue
        current[new] = value
        spellings[new] = old
        log.warning("%s: %s: is an old spelling: write %s", file, old, new)
    for key, advice in NO_EFFECT.get(section, {}).items():
        if _pop(current, key) is not None:
            log.warning("%s: %s: has no effect: %s", file, key, advice)
    object_tf = current.get("object_tf")
    if section in FOLLOWERS and isinstance(object_tf, dict) and object_tf.keys() <= {"hz"}:
        del current["object_tf"]
        log.warning("%s: object_tf: has no effect: %s", file, _FOLLOW)
    return current, spellings, problems


def _pop(data: dict[str, Any], key: str) -> Any:
    """Removes a key, or a nested key such as `object_tf.offset`, and returns its value; None if the key is absent."""
    if key in data:
        return data.pop(key)
    outer, _, inner = key.partition(".")
    return data[outer].pop(inner, None) if inner and isinstance(data.get(outer), dict) else None
