"""`interactive_target_node.py`: a frame that is dragged in RViz."""

from __future__ import annotations

import math

import rospy
import tf2_ros
from geometry_msgs.msg import Point, Pose, Quaternion
from node_world import publishing
from ros_system import wait_until
from visualization_msgs.msg import InteractiveMarkerFeedback, InteractiveMarkerInit

TARGET = Pose(Point(0.3, -0.2, 0.5), Quaternion(0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)))


def test_frame_dragged_in_rviz_is_broadcast_at_its_handles(ros):
    """Under the name that it had in ik_ros."""
    parameters = {"parent_frame_id": "foot", "child_frame_id": "dragged", "position": [0.1, 0.2, 0.3]}
    rospy.set_param("/interactive_target_node", parameters)
    ros.start(["rosrun", "ik_ros", "interactive_target_node.py", "__name:=interactive_target_node"])
    shown = ros.listen("ik_target/update_full", InteractiveMarkerInit).wait_for()[-1].markers[0]
    assert (shown.header.frame_id, shown.name, len(shown.controls)) == ("foot", "dragged", 6)
    buffer = ros.listen_to_tf()

    def position():
        try:
            p = buffer.lookup_transform("foot", "dragged", rospy.Time(0)).transform.translation
        except tf2_ros.TransformException:
            return None
        return p.x, p.y, p.z

    wait_until(lambda: position() == (0.1, 0.2, 0.3), "it is where the parameters say")
    with publishing("ik_target/feedback", InteractiveMarkerFeedback) as mouse:

        def drag(pose):
            feedback = InteractiveMarkerFeedback(
                client_id="test", marker_name="dragged", event_type=InteractiveMarkerFeedback.POSE_UPDATE, pose=pose
            )
            feedback.header.frame_id = "foot"
            mouse.publish(feedback)

        drag(Pose(Point(math.nan, 0, 0), Quaternion(0, 0, 0, 1)))
        wait_until(lambda: drag(TARGET) or position() == (0.3, -0.2, 0.5), "it follows the mouse")
