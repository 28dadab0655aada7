"""TF frames with poses from the main file."""

from collections.abc import Sequence

import rospy
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage

from rpbi.config.world import StaticFrame
from rpbi.ros.endpoints import Topic
from rpbi.ros.headers import named_frame

TF_STATIC = Topic("/tf_static", TFMessage, meaning="Where the frames under `poses` are; latched.")


class StaticFrames:
    """Puts frames on TF once and for all; without any there is no topic."""

    def __init__(self, poses: Sequence[StaticFrame]) -> None:
        if poses:
            self._publisher = rospy.Publisher(TF_STATIC.name, TF_STATIC.message_type, queue_size=1, latch=True)
            self._publisher.publish(static_frames_message(poses))


def static_frames_message(poses: Sequence[StaticFrame]) -> TFMessage:
    """Returns frames with their poses as transforms."""
    return TFMessage([_transform(each) for each in poses])


def _transform(frame: StaticFrame) -> TransformStamped:
    position, quat = frame.pose
    message = TransformStamped(child_frame_id=named_frame(frame.tf_id))
    message.header.frame_id = named_frame(frame.parent)
    message.transform = Transform(Vector3(*position), Quaternion(*quat))
    return message
