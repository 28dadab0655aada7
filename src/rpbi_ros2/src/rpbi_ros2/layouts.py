"""The layout in ROS 2 of each ROS 1 message type, made from its definition and a table of differences."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

from custom_ros_tools.errors import InterfaceError
from rpbi_data.bags.message_layout import SCALAR, MessageType

COMMON_PACKAGES = frozenset(
    "actionlib_msgs diagnostic_msgs geometry_msgs nav_msgs rosgraph_msgs sensor_msgs shape_msgs std_msgs stereo_msgs "
    "tf2_msgs trajectory_msgs visualization_msgs".split()
)
"""Packages of messages that ROS 1 and ROS 2 share."""
OWN_PACKAGES = frozenset(
    "apriltag_ros control_msgs dmp geomagic_touch_x_ros ik_ros keyboard motion_primitives omni_msgs operator_node "
    "ros_pybullet_interface rpbi_mpc rpbi_utils safe_robot".split()
)
"""Packages of messages of this workspace."""
RENAMED_TYPES = {"tf/tfMessage": "tf2_msgs/TFMessage"}
"""Types that have another name in ROS 2."""
DIFFERENT_TYPES = frozenset(
    "control_msgs/JointTrajectoryControllerState control_msgs/PidState rosgraph_msgs/Log rosgraph_msgs/TopicStatistics "
    "sensor_msgs/BatteryState std_msgs/Duration std_msgs/Time".split()
)
"""Types of these packages that ROS 2 lacks, or has with other fields."""
REMOVED = {("std_msgs/Header", "seq")}
"""Fields that only ROS 1 has."""
ADDED = {
    ("visualization_msgs/Marker", "colors"): "string texture_resource\nsensor_msgs/CompressedImage texture\n"
    "visualization_msgs/UVCoordinate[] uv_coordinates",
    ("visualization_msgs/Marker", "mesh_resource"): "visualization_msgs/MeshFile mesh_file",
    ("sensor_msgs/Range", "range"): "float32 variance",
    ("shape_msgs/SolidPrimitive", "dimensions"): "geometry_msgs/Polygon polygon",
}
"""Definitions of fields that only ROS 2 has, by the type and the field that they follow."""
TYPES_OF_ADDED = {
    "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id",
    "sensor_msgs/CompressedImage": "Header header\nstring format\nuint8[] data",
    "visualization_msgs/UVCoordinate": "float32 u\nfloat32 v",
    "visualization_msgs/MeshFile": "string filename\nuint8[] data",
    "geometry_msgs/Polygon": "geometry_msgs/Point32[] points",
    "geometry_msgs/Point32": "float32 x\nfloat32 y\nfloat32 z",
}
"""Definitions of the types of these fields."""
DUMMY = "structure_needs_at_least_one_member"
"""Field of one byte that messages without fields have in ROS 2."""


class Ros2Field(NamedTuple):
    """One field of a message.

    Attributes:
        name: Name in ROS 2.
        type: Name of a primitive type of ROS 1, or a message.
        length: Number of elements of a fixed-length array; `VARIABLE` for other arrays, `SCALAR` for single values.
        only: 1 or 2 if only ROS 1 or only ROS 2 has the field; 0 for both.
    """

    name: str
    type: str | Ros2Type
    length: int = SCALAR
    only: int = 0


@dataclass(frozen=True)
class Ros2Type:
    """A message type of ROS 2, with the fields that only ROS 1 has in their places.

    Attributes:
        name: Name without `msg`, such as `sensor_msgs/JointState`.
        fields: All fields in the order of serialisation.
    """

    name: str
    fields: tuple[Ros2Field, ...]

    @property
    def members(self) -> tuple[Ros2Field, ...]:
        """The fields that ROS 2 has."""
        return tuple(field for field in self.fields if field.only != 1)

    @property
    def dds_name(self) -> str:
        """Name of the type in DDS, as ROS 2 makes it."""
        package, _, name = self.name.partition("/")
        return f"{package}::msg::dds_::{name}_"


class RefusedTypeError(InterfaceError):
    """A message type has no counterpart in ROS 2."""


def ros2_type(name: str, definition: str, packages: frozenset[str]) -> Ros2Type:
    """Returns the layout in ROS 2 of a ROS 1 message type.

    Args:
        name: Name of the type, such as `sensor_msgs/JointState`.
        definition: Its full definition in ROS 1, with the types in it.
        packages: Packages of messages that have the same definitions in ROS 2, in addition to `COMMON_PACKAGES`.

    Raises:
        RefusedTypeError: If the type, or a type in it, has no counterpart in ROS 2.
    """
    try:
        return _converted(MessageType.parse(name, definition), packages)
    except ValueError as error:
        raise RefusedTypeError(str(error)) from None


def _converted(source: MessageType, packages: frozenset[str]) -> Ros2Type:
    name = RENAMED_TYPES.get(source.name, source.name)
    package = name.partition("/")[0]
    if package not in COMMON_PACKAGES | packages:
        raise RefusedTypeError(f"{name}: package {package} is not known in ROS 2")
    if name in DIFFERENT_TYPES:
        raise RefusedTypeError(f"{name} has other fields in ROS 2")
    fields = []
    for field in source.fields:
        inner = field.type if isinstance(field.type, str) else _converted(field.type, packages)
        only = 1 if (name, field.name) in REMOVED else 0
        fields += [Ros2Field(ros2_name(field.name), inner, field.length, only), *_added(name, field.name)]
    return Ros2Type(name, tuple(fields) or (Ros2Field(DUMMY, "uint8", SCALAR, 2),))


def _added(name: str, field: str) -> tuple[Ros2Field, ...]:
    if (name, field) not in ADDED:
        return ()
    definition = ADDED[name, field]
    for inner, text in TYPES_OF_ADDED.items():
        definition += f"\n{'=' * 80}\nMSG: {inner}\n{text}"
    added = _converted(MessageType.parse("std_msgs/Added", definition), frozenset())
    return tuple(each._replace(only=2) for each in added.fields)


@cache
def ros2_name(name: str) -> str:
    """Returns the name of a field in ROS 2: in lower case, with single underscores between words."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
    return re.sub(r"_+", "_", words).strip("_")
