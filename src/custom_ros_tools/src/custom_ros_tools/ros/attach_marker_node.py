"""The node `attach_marker`: publishes a marker for RViz at a fixed pose in a TF frame."""

import logging

import rospy
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from custom_ros_tools.node_configs import SHAPES, MarkerConfig
from custom_ros_tools.ros.lifecycle.parameters import private_config
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import WallTimer

from .transform_messages import TransformTopic, as_pose, transform_message

log = logging.getLogger(__name__)


class AttachMarkerNode:
    """Publishes the marker in `~config` at a fixed rate, and the marker's pose on TF if `broadcast_offset` is true.

    Raises:
        ConfigError: If the configuration is invalid.
    """

    def __init__(self) -> None:
        config = private_config(MarkerConfig)
        if config.type not in SHAPES:
            log.warning("the marker is invisible: type %s needs data that ~config cannot have", config.type)
        self._transform = transform_message(config.position, config.quat_xyzw)
        self._marker = _marker(config)
        self._marker.pose = as_pose(self._transform)
        self._publisher = rospy.Publisher(config.node.topic_name, Marker, queue_size=10)
        child = config.node.child_frame_id if config.node.broadcast_offset else None
        self._topic = TransformTopic(config.frame_id, child) if child else None
        WallTimer(config.node.hz, self._send)

    def _send(self) -> None:
        self._marker.header.stamp = rospy.Time.now()
        self._publisher.publish(self._marker)
        if self._topic is not None:
            self._topic.send(self._transform)


def _marker(config: MarkerConfig) -> Marker:
    """Makes the marker message, but does not set pose and stamp."""
    marker = Marker(type=getattr(Marker, config.type), action=getattr(Marker, config.action))
    marker.header.frame_id = config.frame_id
    marker.ns = rospy.get_name()  # otherwise markers of several nodes on one topic would replace each other
    marker.scale.x, marker.scale.y, marker.scale.z = config.scale
    marker.color = ColorRGBA(*config.rgba)
    marker.mesh_resource = config.mesh_uri
    return marker


def main() -> None:
    """Runs the node."""
    run_node("attach_marker", AttachMarkerNode, anonymous=True)
