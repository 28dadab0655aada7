"""Headers of messages: full names of TF frames, and ROS stamps from the world's clock."""

from collections.abc import Container

import genpy
from std_msgs.msg import Header

from rpbi.config.world import WORLD_FRAME
from rpbi.engine.clock import NS_PER_S

_prefix = ""
_own_frames: Container[str] = ()

FRAMES = {
    "rpbi/world": "The world, parent of all others. Poses in YAML, topics and services are in it.",
    "rpbi/NAME": "A dynamic object with `broadcast_hz`.",
    "rpbi/NAME/LINK": "URDF frames of links: all of a robot with `broadcast_link_states`, its root link with "
    "`broadcast_root_tf_hz`, all of a URDF object with `broadcast_hz`.",
}
"""Meaning of each TF frame that the node publishes; `NAME` stands for a body and `LINK` for one of its links."""


def use_prefix(prefix: str | None) -> None:
    """Sets the prefix of all frames of this node's world, so that two worlds can share a TF tree.

    None removes the prefix.
    """
    global _prefix
    _prefix = f"{prefix}/" if prefix else ""


def use_own_frames(frames: Container[str]) -> None:
    """Sets the frames that belong to this node's world, as names without prefix; see `named_frame`."""
    global _own_frames
    _own_frames = frames


def named_frame(frame: str) -> str:
    """Returns the full name of a frame that a YAML file names.

    The full name begins with the prefix if the frame belongs to this node's world.
    """
    return prefixed(frame) if frame in _own_frames else frame


def prefixed(frame: str) -> str:
    """Returns the name of a frame of this node's world, such as `rpbi/kuka_lwr`, with the prefix in front."""
    return _prefix + frame


def world_frame() -> str:
    """Returns the full name of the world frame: `rpbi/world`, with the prefix in front if one is set."""
    return prefixed(WORLD_FRAME)


def to_ros_time(stamp_ns: int) -> genpy.Time:
    """Converts a stamp [ns] to a ROS time, exactly."""
    stamp: genpy.Time = _new(genpy.Time)
    stamp.secs, stamp.nsecs = divmod(stamp_ns, NS_PER_S)
    return stamp


def stamped_header(stamp_ns: int, frame: str) -> Header:
    """Returns a message header with a stamp [ns] and the full name of a TF frame."""
    header: Header = _new(Header)
    header.seq, header.stamp, header.frame_id = 0, to_ros_time(stamp_ns), frame
    return header


_new = object.__new__
"""Creates times and headers without calling their constructors, which is six times as fast: the constructors check
types and loop over fields."""
