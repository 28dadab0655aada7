"""The nodes around tracking systems: what drivers send becomes frames, and images become tags."""

from __future__ import annotations

import math
from typing import Any

import pytest
import rospy
from apriltag_ros.msg import AprilTagDetection, AprilTagDetectionArray
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from node_world import Rosout, main_config, publishing
from ros_system import wait_until
from tf2_msgs.msg import TFMessage

from robot_model.geometry import Pose, rotation_between
from rpbi_utils.tracking.tags import write_tag

CAMERA = Pose((0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))
"""Looks down from 1 m."""


def sent(stamp_s: float, position: tuple[float, float, float], frame_id: str, **rotation: float) -> TransformStamped:
    """Returns what vicon_bridge sends of a segment."""
    message = TransformStamped(child_frame_id="vicon/box/box")
    message.header.frame_id, message.header.stamp = frame_id, rospy.Time.from_sec(stamp_s)
    message.transform.translation = Vector3(*position)
    message.transform.rotation = Quaternion(**(rotation or {"w": 1.0}))
    return message


def newest(tf: Any, frame: str) -> tuple[str, Pose] | None:
    """Returns parent and pose of a frame that came last on TF."""
    found = [one for message in list(tf.messages) for one in message.transforms if one.child_frame_id == frame]
    if not found:
        return None
    p, q = found[-1].transform.translation, found[-1].transform.rotation
    return found[-1].header.frame_id, Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def start_tracking(ros: Any, objects: list[dict[str, Any]]) -> None:
    """Starts the node that broadcasts objects, unsmoothed."""
    rospy.set_param("/tracked_object/config", {"objects": objects, "smoothing": {"min_cutoff_hz": 0.0}})
    ros.start(["rosrun", "rpbi_utils", "tracked_object_node.py"])


def test_driver_messages_become_frames_and_invalid_ones_are_named(ros) -> None:
    """Millimetres, a frame with a leading slash, a tag in an optical frame, an offset; NaN, zeros and an outlier."""
    turn = {"orientation": [0.0, 0.0, 1.0, 0.0], "position": [0.1, 0.0, 0.0]}
    topics = [f"{side}/tag_detections" for side in ("left", "right")]
    objects = [
        {"name": "box", "vicon": "box/box", "unit": "mm", **turn},
        {"name": "tag", "april_tag": [2, 1], "topics": topics},
    ]
    start_tracking(ros, objects)
    tf, rosout = ros.listen("/tf", TFMessage), Rosout(ros)
    rosout.wait_to_hear("/tracked_object")
    camera = sent(0.0, CAMERA.position, "rpbi/world", x=1.0)
    camera.child_frame_id = "camera"
    bundle = AprilTagDetection(id=[1, 2], size=[0.1, 0.1])
    bundle.pose.header.frame_id, bundle.pose.pose.pose.orientation.x = "camera", 1.0
    with (
        publishing("vicon/box/box", TransformStamped) as vicon,
        publishing(topics[0], AprilTagDetectionArray) as left,
        publishing(topics[1], AprilTagDetectionArray) as right,
        publishing("/tf_static", TFMessage) as static,
    ):
        vicon.publish(sent(1.0, (0.0, 0.0, 0.0), "/vicon/world"))
        wait_until(lambda: rosout.logs("box: left out: no TF from 'rpbi/world' to 'vicon/world'"), "it is named")
        vicon_world = sent(0.0, (0.0, 0.0, 0.2), "rpbi/world")
        vicon_world.child_frame_id = "vicon/world"
        static.publish(TFMessage([camera, vicon_world]))

        def tag_comes(tags: rospy.Publisher, stamp_s: int, z: float) -> Any:
            bundle.pose.header.stamp, bundle.pose.pose.pose.position.z = rospy.Time(stamp_s), 1.0 - z
            tags.publish(AprilTagDetectionArray(detections=[AprilTagDetection(id=[1]), bundle]))
            found = newest(tf, "tag")
            return found if found and found[1].position[2] == pytest.approx(z) else None

        wait_until(lambda: tag_comes(left, 5, 0.1), "the bundle comes")
        parent, pose = wait_until(lambda: tag_comes(right, 6, 0.12), "another camera sees it")
        assert parent == "rpbi/world" and pose.position[:2] == pytest.approx((0.0, 0.0))
        assert math.hypot(*rotation_between(pose.quat_xyzw, (0.0, 0.0, 0.0, 1.0))) < 1e-6

        vicon.publish(sent(2.0, (1000.0, 500.0, 0.0), "/vicon/world"))
        parent, pose = wait_until(lambda: newest(tf, "box"), "the box comes")
        assert parent == "rpbi/world" and pose.position == pytest.approx((1.1, 0.5, 0.2))
        assert pose.quat_xyzw == pytest.approx((0.0, 0.0, 1.0, 0.0))

        vicon.publish(sent(2.01, (2000.0, 500.0, 0.0), "/vicon/world"))
        vicon.publish(sent(2.02, (math.nan, 500.0, 0.0), "/vicon/world"))
        vicon.publish(sent(2.03, (1010.0, 500.0, 0.0), "/vicon/world", w=0.0))
        vicon.publish(sent(2.04, (1010.0, 500.0, 0.0), "/vicon/world"))
        wait_until(lambda: newest(tf, "box")[1].position[0] == pytest.approx(1.11), "the next one comes")
        wait_until(lambda: rosout.logs("box: is lost: no pose for 0.5 s"), "it is lost")
    left_out = [message.msg for message in rosout.logs("box: left out")]
    assert 1 <= len(left_out) <= 4, f"each kind of fault is logged once: {left_out}"
    boxes = [one for message in tf.messages for one in message.transforms if one.child_frame_id == "box"]
    assert sorted({one.transform.translation.x for one in boxes}) == pytest.approx([1.1, 1.11])


def test_a_tag_before_the_simulated_camera_is_found_and_followed(ros, tmp_path) -> None:
    """Images of the simulator become detections by `apriltag_node.py`, these a frame by `tracked_object_node.py`."""
    truth = Pose((0.08, -0.05, 0.2), (0.1, 0.2, 0.3, math.sqrt(1.0 - 0.14)))
    mesh = write_tag(7, 0.1, tmp_path)
    tag = {
        "name": "tag",
        "createVisualShape": {"shapeType": "GEOM_MESH", "fileName": str(mesh)},
        "basePosition": list(truth.position),
        "baseOrientation": list(truth.quat_xyzw),
    }
    camera = {"name": "camera", "hz": 10, "intrinsics": {"fov": 50.0}, "object_tf": {"tf_id": "camera"}}
    pose = {"tf_id": "camera", "position": list(CAMERA.position), "orientation": list(CAMERA.quat_xyzw)}
    rospy.set_param("/apriltag/config", {"standalone_tags": [{"id": 7, "size": 0.1}]})
    ros.simulator(main_config(tmp_path, visual=(tag,), rgbd_sensor=camera, poses=[pose]))
    start_tracking(ros, [{"name": "found", "april_tag": 7}])
    images = "rpbi/camera/colour"
    remaps = [f"image_rect:={images}/image", f"camera_info:={images}/camera_info"]
    ros.start(["rosrun", "rpbi_utils", "apriltag_node.py", *remaps])
    tf, detections = ros.listen("/tf", TFMessage), ros.listen("tag_detections", AprilTagDetectionArray)
    wait_until(lambda: newest(tf, "found") and newest(tf, "tag_7"), "the tag is found")
    seen = wait_until(lambda: [each for each in detections.messages if each.detections], "its detection comes")[0]
    parent, found = newest(tf, "found")
    assert parent == "rpbi/world"
    assert found.position == pytest.approx(truth.position, abs=0.004)
    assert math.hypot(*rotation_between(found.quat_xyzw, truth.quat_xyzw)) < 0.03
    assert newest(tf, "tag_7")[0] == "camera"
    (one,) = seen.detections
    assert (one.id, one.size, one.pose.header.frame_id) == ((7,), (0.1,), "camera")
    assert set(one.pose.pose.covariance) == {0.0}
