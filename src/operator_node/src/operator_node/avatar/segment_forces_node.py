"""`segment_forces_node.py`: computes the force on each segment of the avatar from the avatar's contacts."""

import numpy as np
import rospy
from geometry_msgs.msg import Vector3
from pydantic import Field

from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.schema import ConfigModel, Name
from operator_node.msg import SegmentForces
from operator_node.mvn.segments import SEGMENTS
from ros_pybullet_interface.msg import ContactPoint, Contacts

from .anthropometry import Array
from .segment_forces import forces_by_segment

QUEUE_SIZE = 100


class SegmentForcesParameters(ConfigModel):
    """Private parameters of `segment_forces_node.py`."""

    robot_name: Name = Field("human", description="Name of the avatar, whose YAML file must contain `contacts`.")


class SegmentForcesNode:
    """Adds up the contact forces on each segment of the avatar, and publishes the sums.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        self._name = name = private_parameters(SegmentForcesParameters).robot_name
        self._publisher = rospy.Publisher("avatar/segment_forces", SegmentForces, queue_size=QUEUE_SIZE)
        rospy.Subscriber(f"rpbi/{name}/contacts", Contacts, self._on_contacts, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def _on_contacts(self, message: Contacts) -> None:
        contacts = [(point.link, _force(point)) for point in message.points if point.other_body != self._name]
        sizes = forces_by_segment(SEGMENTS, ((segment, force.tolist()) for segment, force in contacts))
        sums = {segment: np.zeros(3) for segment in SEGMENTS}
        for segment, force in contacts:
            if segment in sums:
                sums[segment] += force
        self._publisher.publish(
            SegmentForces(
                message.header,
                list(SEGMENTS),
                [Vector3(*force.tolist()) for force in sums.values()],
                [each.sum_n for each in sizes.values()],
                [each.largest_n for each in sizes.values()],
            )
        )


def _force(point: ContactPoint) -> Array:
    """Returns the force of a contact point, normal force plus friction (3) [N]."""
    parts = (
        (point.normal, point.normal_force),
        (point.friction_direction_1, point.friction_force_1),
        (point.friction_direction_2, point.friction_force_2),
    )
    return np.sum([size * np.array((direction.x, direction.y, direction.z)) for direction, size in parts], axis=0)


def main() -> None:
    """Runs the node."""
    run_node("segment_forces", SegmentForcesNode)
