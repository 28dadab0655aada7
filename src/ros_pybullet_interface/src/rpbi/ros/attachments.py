"""Topic with all attachments between bodies, and services that add attachments, remove them or apply wrenches."""

import math
from typing import Any

import rospy
from cob_srvs.srv import SetStringRequest
from geometry_msgs.msg import Point, Pose, Quaternion

from ros_pybullet_interface.msg import Attachment, Attachments
from ros_pybullet_interface.srv import ApplyWrenchRequest, AttachRequest
from rpbi.config.world import AttachmentConfig, AttachmentPose
from rpbi.control.external_wrenches import ExternalWrench
from rpbi.world import World

from .endpoints import Answer, Topic
from .headers import to_ros_time

ATTACHMENTS = Topic("rpbi/attachments", Attachments, meaning="Attachments, whenever one is added or removed; latched.")
AXES = {"": False, "world": False, "link": True}
"""For each `frame` of a request, whether the wrench is given in the axes of the link."""


class AttachmentPublisher:
    """Publishes the attachments of a world whenever one is added or removed."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._published = -1
        self._publisher = rospy.Publisher(ATTACHMENTS.name, Attachments, queue_size=10, latch=True)

    def poll(self) -> None:
        """Publishes all attachments, if any was added or removed since the last call."""
        attachments = self._world.attachments
        if self._published == attachments.changes:
            return
        self._published = attachments.changes
        message = Attachments(
            attachments=[_message(each) for each in attachments.configs], last_change=attachments.last_change
        )
        message.header.stamp = to_ros_time(self._world.clock.stamp_ns)
        self._publisher.publish(message)


def attach(node: Any, request: AttachRequest) -> Answer:
    """Attaches a link of an object to a link of another object, as a magnet or a tool changer does.

    Raises:
        ConfigError: If a field of the request is invalid; the error lists all problems.
    """
    asked = request.attachment
    config = AttachmentConfig.parse(_keys(asked), "attachment")
    node.ask(lambda: node.simulation.world.attach(config))
    return Answer(True, f"'{config.child}' is attached to '{config.parent}'")


def detach(node: Any, request: SetStringRequest) -> Answer:
    """Removes the attachment with a given name."""
    node.ask(lambda: node.simulation.world.detach(request.data))
    return Answer(True, f"detached '{request.data}'")


def apply_wrench(node: Any, request: ApplyWrenchRequest) -> Answer:
    """Applies a force and a torque to an object or a link, for a given time or until another wrench replaces them.

    Raises:
        ValueError: If the request's `frame` is not `world`, `link` or empty, or a number is invalid.
    """
    if request.frame not in AXES:
        raise ValueError(f"frame: expected world or link, got '{request.frame}'")
    if math.isnan(request.duration):
        raise ValueError("duration: must be a number [s], got nan")
    name, _, link = request.object_name.partition("/")
    force, torque, point = request.wrench.force, request.wrench.torque, request.point
    wrench = ExternalWrench(
        (force.x, force.y, force.z),
        (torque.x, torque.y, torque.z),
        link,
        (point.x, point.y, point.z),
        AXES[request.frame],
        request.duration if 0.0 < request.duration < math.inf else None,
    )
    node.ask(lambda: node.simulation.world.act(name, "push", wrench))
    for_how_long = "until replaced" if wrench.duration_s is None else f"for {wrench.duration_s:g} s"
    return Answer(True, f"acts on '{request.object_name}' {for_how_long}")


def _message(config: AttachmentConfig) -> Attachment:
    poses = map(_pose_message, (config.parent_pose, config.child_pose))
    return Attachment(config.name, config.parent, config.child, config.kind, *poses, config.max_force or 0.0)


def _pose_message(pose: AttachmentPose | None) -> Pose:
    return Pose() if pose is None else Pose(Point(*pose.position), Quaternion(*pose.orientation))


def _keys(asked: Attachment) -> dict[str, Any]:
    """Converts a message to the YAML keys of an attachment; optional keys whose value is zero or empty are left out."""
    keys = {key: getattr(asked, key) for key in ("name", "parent", "child")}
    keys |= {key: value for key in ("kind", "max_force") if (value := getattr(asked, key))}
    return keys | {key: pose for key in ("parent_pose", "child_pose") if (pose := _pose_keys(getattr(asked, key)))}


def _pose_keys(pose: Pose) -> dict[str, list[float]]:
    """Converts a pose to YAML keys; returns an empty mapping if all numbers are zero."""
    position = [pose.position.x, pose.position.y, pose.position.z]
    orientation = [pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w]
    return {"position": position, "orientation": orientation} if any(position + orientation) else {}
