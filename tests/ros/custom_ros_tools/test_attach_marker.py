"""The node that shows a marker in a TF frame."""

from __future__ import annotations

import math
from typing import Any

import pytest
import rospy
from ros_system import stop_group, wait_until
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

from custom_ros_tools.node_configs import MARKER_ACTIONS, MARKER_TYPES

CUP: dict[str, Any] = {
    "node": {"topic_name": "cup/marker", "broadcast_offset": True, "child_frame_id": "cup"},
    "frame_id": "table",
    "type": "cylinder",
    "position": [0.1, 0.2, 0.3],
    "orientation": [0.0, 0.0, 90.0],
    "ori_in_deg": True,
    "rgba": [1.0, 0.5, 0.0, 1.0],
    "scale": [0.1, 0.2, 0.4],
}


def start(ros, config: Any, *arguments: str):
    """Starts the node."""
    rospy.set_param("/marker/config", config)
    return ros.start(["rosrun", "custom_ros_tools", "attach_marker", "__name:=marker", *arguments])


def test_names_of_types_and_actions_are_constants_of_the_message():
    assert [name for name in (*MARKER_TYPES, *MARKER_ACTIONS) if not isinstance(getattr(Marker, name), int)] == []


@pytest.mark.quick
def test_marker_equals_its_configuration(ros):
    start(ros, CUP)
    [marker] = ros.listen("/cup/marker", Marker).wait_for(1)[:1]
    assert (marker.header.frame_id, marker.type, marker.action) == ("table", Marker.CYLINDER, Marker.ADD)
    pose, scale, colour = marker.pose, marker.scale, marker.color
    assert (pose.position.x, pose.position.y, pose.position.z) == (0.1, 0.2, 0.3)
    turn = (pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w)
    assert turn == pytest.approx((0, 0, math.sqrt(0.5), math.sqrt(0.5)))
    assert (scale.x, scale.y, scale.z) == (0.1, 0.2, 0.4)
    assert (colour.r, colour.g, colour.b, colour.a) == (1.0, 0.5, 0.0, 1.0)
    assert marker.header.stamp > rospy.Time(0)


def test_marker_pose_is_broadcast_on_request(ros):
    start(ros, CUP)
    [transform] = ros.listen("/tf", TFMessage).wait_for(1)[0].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("table", "cup")
    assert (transform.transform.translation.z, transform.transform.rotation.z) == pytest.approx((0.3, math.sqrt(0.5)))


def test_pose_of_the_marker_is_not_broadcast_otherwise(ros):
    transforms = ros.listen("/tf", TFMessage)
    start(ros, {**CUP, "node": {"topic_name": "cup/marker"}})
    ros.listen("/cup/marker", Marker).wait_for(20)
    assert not transforms.messages


def test_marker_is_repeated_while_there_is_no_clock(ros):
    """RViz shows what has no stamp at its newest pose."""
    rospy.set_param("/use_sim_time", True)
    start(ros, CUP)
    markers = ros.listen("/cup/marker", Marker).wait_for(20)
    assert markers[-1].header.stamp == rospy.Time(0)


def test_several_nodes_do_not_replace_each_others_markers(ros, tmp_path):
    node = """
      <node pkg="custom_ros_tools" type="attach_marker" name="{}">
        <rosparam>{{node: {{topic_name: markers}}, type: sphere, scale: [1, 1, 1]}}</rosparam>
      </node>"""
    node = node.replace("<rosparam>", '<rosparam param="config">')
    (tmp_path / "two.launch").write_text(f"<launch>{node.format('left')}{node.format('right')}</launch>")
    ros.start(["roslaunch", str(tmp_path / "two.launch")])
    markers = ros.listen("/markers", Marker)
    wait_until(lambda: {m.ns for m in markers.messages} == {"/left", "/right"}, "both are seen under own names")


@pytest.mark.parametrize(
    ("config", "told"),
    [
        ({**CUP, "orientation": [0, 0, 0, 0]}, "~config: orientation: quaternion: must not be zero"),
        ({**CUP, "type": "cup", "scale": [1]}, "~config: scale: expected a list of 3 numbers, got 1"),
        ("cup", "~config: expected a mapping of keys to values, got str"),
    ],
)
def test_wrong_configuration_is_named_and_ends_the_node(ros, config, told):
    process = start(ros, config)
    assert process.wait(60.0) == 1
    assert told in ros.output(process) and "Traceback" not in ros.output(process)


def test_missing_configuration_is_named(ros):
    process = ros.start(["rosrun", "custom_ros_tools", "attach_marker"])
    assert process.wait(60.0) == 1
    for key in ("node", "type", "scale"):
        assert f"~config: {key}: missing" in ros.output(process)


def test_invisible_marker_is_reported(ros):
    process = start(ros, {**CUP, "type": "line_strip"})
    [marker] = ros.listen("/cup/marker", Marker).wait_for(1)[:1]
    assert marker.type == Marker.LINE_STRIP
    assert "the marker is invisible: type LINE_STRIP needs" in ros.output(process)


def test_ctrl_c_ends_it_cleanly(ros):
    process = start(ros, CUP)
    ros.listen("/cup/marker", Marker).wait_for(1)
    assert stop_group(process) == 0
    assert "Traceback" not in ros.output(process)
