"""Headers of messages: names of TF frames, and stamps of the world's clock."""

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
"""Frames that the node puts on TF, and the bodies that have them; `NAME` is a body and `LINK` one of its links."""


def use_prefix(prefix: str | None) -> None:
    """Puts a prefix before all frames of this node's world, so that two worlds can share one TF tree."""
    global _prefix
    _prefix = f"{prefix}/" if prefix else ""


def use_own_frames(frames: Container[str]) -> None:
    """Resolves these frames, without prefix, to those of this node's world wherever YAML names them."""
    global _own_frames
    _own_frames = frames


def named_frame(frame: str) -> str:
    """Returns the full name of a frame that YAML names: with the prefix if it is one of this node's world."""
    return prefixed(frame) if frame in _own_frames else frame


def prefixed(frame: str) -> str:
    """Returns the full name of a frame of this node's world, such as `rpbi/kuka_lwr`."""
    return _prefix + frame


def world_frame() -> str:
    """Returns the frame that all poses are in: `rpbi/world`, with the prefix if there is one."""
    return prefixed(WORLD_FRAME)


def to_ros_time(stamp_ns: int) -> genpy.Time:
    """Returns a stamp [ns] as a ROS time, without going through a float."""
    stamp: genpy.Time = _new(genpy.Time)
    stamp.secs, stamp.nsecs = divmod(stamp_ns, NS_PER_S)
    return stamp


def stamped_header(stamp_ns: int, frame: str) -> Header:
    """Returns the header of a message with a stamp [ns], in a frame given by its full name."""
    header: Header = _new(Header)
    header.seq, header.stamp, header.frame_id = 0, to_ros_time(stamp_ns), frame
    return header


_new = object.__new__
"""Makes times and headers without their constructors, which check types and loop over fields: six times as fast."""
