"""Attachments as a topic."""

import rospy
from geometry_msgs.msg import Point, Pose, Quaternion

from ros_pybullet_interface.msg import Attachment, Attachments
from rpbi.config.attachments import AttachmentConfig, AttachmentPose
from rpbi.ros.endpoints import Topic
from rpbi.ros.headers import to_ros_time
from rpbi.world import World

ATTACHMENTS = Topic("rpbi/attachments", Attachments, meaning="Attachments, whenever one is added or removed; latched.")


class AttachmentPublisher:
    """Publishes the attachments of a world when one comes or goes."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._published = -1
        self._publisher = rospy.Publisher(ATTACHMENTS.name, Attachments, queue_size=10, latch=True)

    def poll(self) -> None:
        """Publishes changes, if any."""
        attachments = self._world.attachments
        if self._published == attachments.changes:
            return
        self._published = attachments.changes
        message = Attachments(
            attachments=[_message(each) for each in attachments.configs], last_change=attachments.last_change
        )
        message.header.stamp = to_ros_time(self._world.clock.stamp_ns)
        self._publisher.publish(message)


def _message(config: AttachmentConfig) -> Attachment:
    poses = map(_pose, (config.parent_pose, config.child_pose))
    return Attachment(config.name, config.parent, config.child, config.kind, *poses, config.max_force or 0.0)


def _pose(pose: AttachmentPose | None) -> Pose:
    return Pose() if pose is None else Pose(Point(*pose.position), Quaternion(*pose.orientation))
