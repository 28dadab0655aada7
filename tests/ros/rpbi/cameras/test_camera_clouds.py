"""Point clouds and several cameras, as other nodes see them."""

from __future__ import annotations

import numpy as np
import pytest
import rospy
import yaml
from camera_world import CAMERA, HEIGHT_M, box_world, place, points_of
from cob_srvs.srv import SetString
from ros_system import wait_until
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_srvs.srv import Trigger

from ros_pybullet_interface.srv import ListObjects

CLOUD, COLOUR, DEPTH = (f"/rpbi/camera/{suffix}" for suffix in ("pointcloud", "colour/image", "depth/image"))


@pytest.fixture(autouse=True)
def placed(ros):
    with place("rpbi/eye", "rpbi/other"):
        yield


def topics_of_cameras():
    return {name for name, kind in rospy.get_published_topics() if kind.startswith("sensor_msgs/") and "image" in name}


@pytest.mark.quick
def test_organised_cloud_agrees_with_the_images_of_its_frame(ros):
    listeners = [ros.listen(CLOUD, PointCloud2), ros.listen(DEPTH, Image), ros.listen(COLOUR, Image)]
    ros.simulator(box_world(ros, rgbd_sensor={**CAMERA, "pointcloud": True}), use_sim_time=True)

    def shared():
        return set.intersection(*(set(listener.stamps_ns) for listener in listeners))

    stamp = min(wait_until(shared, "a frame is complete"))
    cloud, depth, colour = (
        next(message for message in listener.messages if message.header.stamp.to_nsec() == stamp)
        for listener in listeners
    )
    assert (cloud.height, cloud.width, cloud.point_step, cloud.row_step) == (120, 160, 16, 2560)
    assert not cloud.is_dense and not cloud.is_bigendian
    assert cloud.header.frame_id == "rpbi/eye"
    points = points_of(cloud)
    depth_m = np.frombuffer(depth.data, np.float32).reshape(120, 160)
    seen = depth_m < 9.9
    assert np.array_equal(points[..., 2][seen], depth_m[seen])
    packed = np.ascontiguousarray(points[..., 3]).view(np.uint8).reshape(120, 160, 4)[..., 2::-1]
    assert np.array_equal(packed, np.frombuffer(colour.data, np.uint8).reshape(120, 160, 3))
    red = packed[..., 0].astype(int) > 2 * packed[..., 1].astype(int)
    top = points[red]
    assert np.abs(top[:, :2]).max() == pytest.approx(0.1, abs=0.01)  # the box, where it is and as large as it is
    assert top[:, 2] == pytest.approx(HEIGHT_M - 0.2, abs=2e-3)


@pytest.mark.thorough
def test_several_cameras_have_their_own_topics_sizes_and_rates(ros):
    small = {**CAMERA, "name": "small", "hz": 10, "intrinsics": {**CAMERA["intrinsics"], "width": 80, "height": 60}}
    small["object_tf"] = {"tf_id": "rpbi/other"}
    file = ros.write_yaml("small.yaml", small)
    further = [file, {"file": file, "name": "third"}]
    slowly = 0.3  # a busy machine drops images
    main = box_world(ros, rgbd_sensor=CAMERA, rgbd_sensors=further, real_time_factor=slowly)
    first, second = ros.listen(DEPTH, Image), ros.listen("/rpbi/small/depth/image", Image)
    info = ros.listen("/rpbi/third/camera_info", CameraInfo)
    ros.simulator(main, use_sim_time=True)
    first.wait_for(2), second.wait_for(5)
    assert (first.messages[0].width, second.messages[0].width, info.wait_for(1)[0].width) == (160, 80, 80)
    assert second.messages[0].header.frame_id == "rpbi/other"
    assert all(step_ns % 100_000_000 == 0 for step_ns in np.diff(second.stamps_ns))
    wait_until(lambda: min(np.diff(first.stamps_ns)) < 40_000_000, "two of 30 Hz come one after the other")


def test_later_camera_may_not_take_the_topics_of_the_first(ros):
    file = ros.write_yaml("camera.yaml", {**CAMERA, "name": "camera"})
    node = ros.simulator(box_world(ros, rgbd_sensor=CAMERA, rgbd_sensors=[file]), wait=False)
    assert node.wait(60.0) == 1
    assert "name: topics of the first camera are named 'camera'" in ros.output(node)


def test_cameras_come_and_go_by_service(ros):
    ros.simulator(box_world(ros), use_sim_time=True)
    assert not topics_of_cameras()
    answer = ros.call("/rpbi/add_rgbd_sensor", SetString, yaml.safe_dump({**CAMERA, "pointcloud": True}))
    assert answer.success, answer.message
    assert points_of(ros.listen(CLOUD, PointCloud2).wait_for(2)[-1]).shape == (120, 160, 4)
    file = ros.write_yaml("wide.yaml", {**CAMERA, "intrinsics": {"width": 800, "height": 200}})
    answer = ros.call("/rpbi/add_rgbd_sensor", SetString, yaml.safe_dump({"file": file, "name": "wide"}))
    assert answer.success, answer.message
    wide = ros.listen("/rpbi/wide/depth/image", Image).wait_for(2)[-1]
    centre_m = np.frombuffer(wide.data, np.float32).reshape(200, 800)[100, 400]
    assert centre_m == pytest.approx(HEIGHT_M - 0.2, abs=2e-3)
    listed = ros.call("/rpbi/list_objects", ListObjects)
    assert dict(zip(listed.names, listed.types))["wide"] == "rgbd_sensor"
    for name in ("eye", "wide"):
        assert ros.call("/rpbi/remove_pybullet_object", SetString, name).success
    wait_until(lambda: not topics_of_cameras(), "their topics have gone")
    again = ros.call("/rpbi/add_rgbd_sensor", SetString, yaml.safe_dump(CAMERA))
    assert again.success, again.message
    assert ros.listen(DEPTH, Image).wait_for(2)


def test_reset_removes_cameras_added_by_service_and_restores_removed_ones(ros):
    ros.simulator(box_world(ros, rgbd_sensor=CAMERA), use_sim_time=True)
    late = {**CAMERA, "name": "late"}
    assert ros.call("/rpbi/add_rgbd_sensor", SetString, yaml.safe_dump(late)).success
    wait_until(lambda: is_published("/rpbi/late/depth/image"), "the renderer has added it")
    assert ros.call("/rpbi/remove_pybullet_object", SetString, "eye").success
    wait_until(lambda: not is_published(DEPTH), "the renderer has removed it")
    assert ros.call("/rpbi/reset", Trigger).success
    listed = ros.call("/rpbi/list_objects", ListObjects)
    assert [name for name, kind in zip(listed.names, listed.types) if kind == "rgbd_sensor"] == ["eye"]
    # rospy's subscribers stay without a publisher that goes and comes back while they connect
    wait_until(lambda: is_published(DEPTH) and not is_published("/rpbi/late/depth/image"), "the topics have changed")
    depth = ros.listen(DEPTH, Image).wait_for(2)[-1]
    assert np.frombuffer(depth.data, np.float32).reshape(120, 160)[60, 80] == pytest.approx(HEIGHT_M - 0.2, abs=2e-3)


def is_published(topic: str) -> bool:
    """Tells whether the master knows somebody who publishes a topic."""
    return any(name == topic for name, _ in rospy.get_published_topics())
