"""`interactive_target_node.py`: broadcasts a TF frame that the user drags and rotates in RViz."""

import math

from geometry_msgs.msg import Quaternion
from interactive_markers.interactive_marker_server import InteractiveMarkerServer
from pydantic import Field
from visualization_msgs.msg import InteractiveMarker, InteractiveMarkerControl, InteractiveMarkerFeedback

from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning, WallTimer
from custom_ros_tools.ros.transform_messages import TransformTopic, as_pose, transform_message
from custom_ros_tools.schema import ConfigModel, FrameId, Hz, Position, PositiveMetres, Quat

NAMESPACE = "ik_target"
"""Namespace of the topics: RViz's display InteractiveMarkers expects `/ik_target/update`."""
HALF_TURN = math.sqrt(0.5)
AXES = {"x": (HALF_TURN, 0.0, 0.0), "y": (0.0, 0.0, HALF_TURN), "z": (0.0, HALF_TURN, 0.0)}
"""For each axis, components x, y, z of the quaternion that orients a handle along this axis. w equals HALF_TURN."""


class InteractiveTargetConfig(ConfigModel):
    """Names, initial pose and handles of a TF frame that the user drags in RViz."""

    parent_frame_id: FrameId = Field(description="TF frame in which the target is given.")
    child_frame_id: FrameId = Field(description="TF frame of the target.")
    position: Position = Field((0.0, 0.0, 0.0), description="Initial position in the parent frame.")
    quat_xyzw: Quat = Field((0.0, 0.0, 0.0, 1.0), description="Initial orientation in the parent frame, x, y, z, w.")
    size_m: PositiveMetres = Field(0.2, description="Size of the interactive marker's handles.")
    hz: Hz = Field(50.0, description="Rate at which the target is broadcast, in wall time.")


class InteractiveTarget:
    """Shows handles in RViz, and broadcasts the frame at the pose of the handles.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        config = private_parameters(InteractiveTargetConfig)
        self._topic = TransformTopic(config.parent_frame_id, config.child_frame_id)
        self._transform = transform_message(config.position, config.quat_xyzw)
        self._warn = ThrottledWarning()
        self._server = InteractiveMarkerServer(NAMESPACE)
        self._server.insert(_marker(config), self._on_feedback)
        self._server.applyChanges()
        WallTimer(config.hz, lambda: self._topic.send(self._transform))

    def _on_feedback(self, feedback: InteractiveMarkerFeedback) -> None:
        p, q = feedback.pose.position, feedback.pose.orientation
        try:
            self._transform = transform_message((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
        except ValueError as error:
            self._warn(f"{NAMESPACE}/feedback", f"pose refused: {error}")


def _marker(config: InteractiveTargetConfig) -> InteractiveMarker:
    """Returns an interactive marker with handles for translations along, and rotations about, the frame's axes."""
    marker = InteractiveMarker(name=config.child_frame_id, scale=config.size_m)
    marker.header.frame_id = config.parent_frame_id
    marker.pose = as_pose(transform_message(config.position, config.quat_xyzw))
    for axis, (x, y, z) in AXES.items():
        for name, mode in (
            ("move", InteractiveMarkerControl.MOVE_AXIS),
            ("turn", InteractiveMarkerControl.ROTATE_AXIS),
        ):
            control = InteractiveMarkerControl(name=f"{name}_{axis}", interaction_mode=mode)
            control.orientation = Quaternion(x, y, z, HALF_TURN)
            marker.controls.append(control)
    return marker


def main() -> None:
    """Runs the node."""
    run_node("interactive_target", InteractiveTarget, anonymous=True)
