"""Messages of ROS 1 in CDR, as ROS 2 has them, and back; `rosbags` is the other implementation of CDR."""

from __future__ import annotations

import json
import random
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from random_messages import converted_classes, random_message, without_seq
from ros2_system import ros2_folder
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty
from visualization_msgs.msg import Marker

from rpbi_data.bags.message_layout import SCALAR, VARIABLE
from rpbi_ros2.cdr import LITTLE_ENDIAN, Converter
from rpbi_ros2.layouts import COMMON_PACKAGES, OWN_PACKAGES, RefusedTypeError, Ros2Field, Ros2Type, ros2_type
from rpbi_ros2.type_hash import full_name, message_of, type_hash

pytestmark = pytest.mark.quick
NOT_IN_DEBIAN = {"shape_msgs", "stereo_msgs"}
PACKAGES = sorted((COMMON_PACKAGES | OWN_PACKAGES) - NOT_IN_DEBIAN)
JAZZY = get_typestore(Stores.ROS2_JAZZY)
SEEDS = range(4)
OTHER_HASH = {"std_msgs/msg/Char"}
"""Types whose hashes rosbags makes for `char`, which is `uint8` in ROS 2; its wheels have the true ones."""


def layout_of(message_class: Any) -> Ros2Type:
    return ros2_type(message_class._type, message_class._full_text, OWN_PACKAGES)


def raw_of(message: Any) -> bytes:
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def register(layout: Ros2Type) -> None:
    """Adds a type and those in it to the types of rosbags, which has the standard ones."""
    if full_name(layout) in JAZZY.fielddefs:
        return
    for inner in filter(None, map(message_of, layout.members)):
        register(inner)
    JAZZY.register({full_name(layout): ([], [(field.name, node_of(field)) for field in layout.members])})


def node_of(field: Ros2Field) -> Any:
    inner = message_of(field)
    node: Any = (Nodetype.BASE, (field.type, 0)) if inner is None else (Nodetype.NAME, full_name(inner))
    if field.length == VARIABLE:
        return Nodetype.SEQUENCE, (node, 0)
    return node if field.length == SCALAR else (Nodetype.ARRAY, (node, field.length))


@pytest.mark.parametrize("package", PACKAGES)
def test_random_messages_return_equal(package):
    """Values, strings, empty and long arrays; the bytes of numbers stay, and so do those of infinities."""
    for message_class, layout in converted_classes(package):
        converter = Converter.of(layout)
        for seed in SEEDS:
            message = random_message(message_class, random.Random(seed))
            cdr = converter.to_cdr(raw_of(message))
            back = message_class().deserialize(converter.from_cdr(cdr))
            sent = message_class().deserialize(raw_of(message))
            assert without_seq(back) == without_seq(sent), message_class._type
            assert converter.to_cdr(raw_of(back)) == cdr


@pytest.mark.parametrize("package", PACKAGES)
def test_layout_hash_and_bytes_are_those_of_jazzy(package):
    for message_class, layout in converted_classes(package):
        name, converter = full_name(layout), Converter.of(layout)
        register(layout)
        assert [field.name for field in layout.members] == [field for field, _ in JAZZY.fielddefs[name][1]]
        assert name in OTHER_HASH or type_hash(layout) == JAZZY.hash_rihs01(name), name
        for seed in SEEDS:
            cdr = converter.to_cdr(raw_of(random_message(message_class, random.Random(seed))))
            again = bytes(JAZZY.serialize_cdr(JAZZY.deserialize_cdr(cdr, name), name))
            assert cdr[: len(again)] == again and not any(cdr[len(again) :]), name


def test_hashes_are_those_of_the_wheels_of_ros2():
    compared = 0
    for package in PACKAGES:
        for _, layout in converted_classes(package):
            path = ros2_folder() / f"share/{package}/msg/{layout.name.rpartition('/')[2]}.json"
            if path.exists():
                compared += 1
                hashes = {
                    each["type_name"]: each["hash_string"] for each in json.loads(path.read_text())["type_hashes"]
                }
                assert type_hash(layout) == hashes[full_name(layout)], layout.name
    assert compared > 100


def test_own_messages_are_converted_and_others_refused_by_name():
    names = {message_class._type for package in PACKAGES for message_class, _ in converted_classes(package)}
    assert {"ros_pybullet_interface/Contacts", "safe_robot/Status", "operator_node/HapticState"} <= names
    with pytest.raises(RefusedTypeError, match="package my_robot is not known in ROS 2"):
        ros2_type("my_robot/State", "float64 x", OWN_PACKAGES)
    with pytest.raises(RefusedTypeError, match="my_robot"):
        ros2_type("std_msgs/Sum", f"my_robot/State x\n{'=' * 80}\nMSG: my_robot/State\nfloat64 x", OWN_PACKAGES)
    assert ros2_type("my_robot/State", "float64 x", frozenset(["my_robot"])).dds_name == "my_robot::msg::dds_::State_"
    with pytest.raises(RefusedTypeError, match="std_msgs/Time has other fields in ROS 2"):
        ros2_type("std_msgs/Time", "time data", OWN_PACKAGES)


def test_message_without_fields_has_one_byte():
    converter = Converter.of(layout_of(Empty))
    assert converter.to_cdr(b"") == LITTLE_ENDIAN + bytes(4) and converter.from_cdr(LITTLE_ENDIAN + b"\1") == b""


def test_fields_that_only_ros2_has_are_empty_and_skipped():
    converter = Converter.of(layout_of(Marker))
    raw = raw_of(Marker(text="a", mesh_resource="b"))
    name = "visualization_msgs/msg/Marker"
    marker = JAZZY.deserialize_cdr(converter.to_cdr(raw), name)
    assert (marker.texture_resource, len(marker.texture.data), marker.text) == ("", 0, "a")
    marker.texture_resource, marker.texture.data, marker.mesh_file.filename = "b", np.ones(5, np.uint8), "c"
    assert converter.from_cdr(bytes(JAZZY.serialize_cdr(marker, name))) == raw


HEADER = "00 01 00 00"
BROKEN = {
    "no bytes": "",
    "no body": HEADER,
    "big-endian": "00 00 00 00" + " 00" * 20,
    "another serialisation": "00 07 00 00" + " 00" * 20,
    "a long string": HEADER + " 00" * 8 + " ff ff ff 7f" + " 00" * 20,
    "a string without end": HEADER + " 00" * 8 + " 02 00 00 00 61 62" + " 00" * 80,
    "many values": HEADER + " 00" * 8 + " 01 00 00 00 00 00 00 00 00 00 00 00 ff ff ff ff" + " 00" * 20,
    "more than the message": HEADER + " 00" * 400,
}


@pytest.mark.parametrize("text", BROKEN.values(), ids=BROKEN.keys())
def test_broken_messages_are_refused(text):
    converter = Converter.of(layout_of(JointState))
    with pytest.raises(ValueError, match="\\w"):
        converter.from_cdr(bytes.fromhex(text))


def test_random_bytes_are_refused_or_are_messages():
    generator = random.Random(1)
    for message_class in (JointState, PoseStamped, Marker):
        converter = Converter.of(layout_of(message_class))
        good = bytearray(converter.to_cdr(raw_of(random_message(message_class, generator))))
        for _ in range(300):
            bad = good[: generator.randrange(len(good))] if generator.random() < 0.3 else bytearray(good)
            for at in generator.choices(range(len(bad)), k=3) if bad else ():
                bad[at] = generator.randrange(256)
            try:
                raw = converter.from_cdr(bytes(bad))
            except ValueError:
                continue
            message_class().deserialize(raw)
