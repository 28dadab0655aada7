"""Messages that are packed in one go have the bytes that their types write."""

from __future__ import annotations

from io import BytesIO

import genpy
import pytest
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from rpbi.ros.publishers.packed_messages import PackedJointState, PackedTransforms

HEADER = Header(7, genpy.Time(3, 999_999_999), "")


def written(message):
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


@pytest.mark.parametrize(
    "fields",
    [
        (HEADER, ("a", "b"), (0.1, -0.0), (1e-300, 2.0), (3.0, float("inf"))),
        (Header(1, genpy.Time(1), "frame"), ["grüße"], [1], [2.0], [3.0]),
        (HEADER, (), (), (), ()),
        (HEADER, ("a", "b"), (0.1, 0.2), (), ()),
    ],
    ids=["usual", "frame and odd letters", "no joints", "positions only"],
)
def test_joint_states(fields):
    assert written(PackedJointState(*fields)) == written(JointState(*fields))


def test_joint_states_with_invalid_numbers_are_refused_as_by_rospy():
    fields = (HEADER, ("a",), ("x",), (0.0,), (0.0,))
    with pytest.raises(genpy.SerializationError) as expected:
        written(JointState(*fields))
    with pytest.raises(genpy.SerializationError) as raised:
        written(PackedJointState(*fields))
    assert str(raised.value) == str(expected.value)


def test_empty_joint_states_are_filled_by_deserialization():
    message = JointState(HEADER, ["a"], [0.1], [0.2], [0.3])
    assert written(PackedJointState()) == written(JointState())
    assert written(PackedJointState().deserialize(written(message))) == written(message)


@pytest.mark.parametrize("count", [0, 1, 3])
def test_transforms(count):
    place = Transform(Vector3(0.1, -0.0, 3.0), Quaternion(0.0, 0.6, 0.0, -0.8))
    transforms = [TransformStamped(HEADER, f"rpbi/ü/{number}", place) for number in range(count)]
    assert written(PackedTransforms(transforms)) == written(TFMessage(transforms))
