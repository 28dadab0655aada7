"""One camera without a point cloud, which goes on while others are refused; all in one world."""

from __future__ import annotations

import pytest
import rospy
from camera_world import CAMERA, box_world, place
from cob_srvs.srv import SetString
from sensor_msgs.msg import Image

CLOUD, DEPTH = "/rpbi/camera/pointcloud", "/rpbi/camera/depth/image"


@pytest.fixture(scope="module", autouse=True)
def placed(module_ros):
    with place("rpbi/eye"):
        yield


@pytest.fixture(scope="module")
def plain(module_ros):
    """A world with one camera."""
    return module_ros.simulator(box_world(module_ros, rgbd_sensor=CAMERA), use_sim_time=True)


def test_there_is_no_cloud_unless_it_is_asked_for(ros, plain):
    ros.listen(DEPTH, Image).wait_for(1)
    assert CLOUD not in dict(rospy.get_published_topics())


@pytest.mark.parametrize(
    "text, complaint",
    [
        ("{name: eye, object_tf: {tf_id: eye}}", "'eye' is taken already"),
        ("{name: new}", "object_tf: missing"),
        ("{name: new, object_tf: {tf_id: eye}, hz: -1}", "hz: must be > 0"),
        ("{name: new, object_tf: {tf_id: eye}, pointclouds: true}", "did you mean 'pointcloud'"),
        ("{file: nowhere.yaml}", "nowhere.yaml"),
        ("[1", "expected"),
        ("", "name: missing"),
    ],
)
def test_invalid_camera_is_refused_and_the_others_continue(ros, plain, text, complaint):
    answer = ros.call("/rpbi/add_rgbd_sensor", SetString, text)
    assert not answer.success and complaint in answer.message, answer.message
    ros.listen(DEPTH, Image).wait_for(2)
