"""What a camera publishes, as other nodes see it."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import time

import numpy as np
import pytest
import rosgraph
import rospy
from geometry_msgs.msg import TransformStamped
from ros_system import wait_until
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from worlds import FLOOR, box, iiwa

CAMERA = {
    "name": "eye",
    "hz": 30,
    "intrinsics": {"width": 160, "height": 120, "fov": 50.0, "range": [0.1, 10.0]},
    "object_tf": {"tf_id": "rpbi/eye"},
}
COLOUR, DEPTH, SEGMENTATION = (f"/rpbi/camera/{suffix}" for suffix in ("colour/image", "depth/image", "segmentation"))
COLOUR_INFO, DEPTH_INFO = "/rpbi/camera/colour/camera_info", "/rpbi/camera/depth/camera_info"
HEIGHT_M = 2.0


def world(ros, **more):
    """Returns the main configuration of a box on a floor beside an arm, seen by a camera."""
    files = {}
    sections = {"collision_objects": FLOOR, "dynamic_objects": box(), "robots": iiwa()}
    for section, config in sections.items():
        files[section] = [ros.write_yaml(f"{config['name']}.yaml", config)]
    return {
        "connect": {"connection_mode": "DIRECT"},
        "setAdditionalSearchPath": "pybullet_data_path",
        "timeStep": 0.01,
        "rgbd_sensor": CAMERA,
        **files,
        **more,
    }


@pytest.fixture
def place_camera(ros):
    """Puts the camera above the floor, looking straight down."""
    publishers = []

    def place():
        message = TransformStamped(child_frame_id="rpbi/eye")
        message.header.frame_id = "rpbi/world"
        message.transform.translation.z = HEIGHT_M
        message.transform.rotation.x = 1.0
        publishers.append(rospy.Publisher("/tf_static", TFMessage, latch=True, queue_size=1))
        publishers[0].publish(TFMessage([message]))

    yield place
    for publisher in publishers:
        publisher.unregister()


def pixels(message, dtype, channels=1):
    return np.frombuffer(message.data, dtype).reshape(message.height, message.width, channels).squeeze()


def renderers(simulator):
    """Returns the process ids of all renderers that a simulator has."""
    found = subprocess.run(["pgrep", "-g", str(simulator.pid), "-f", "rpbi.render"], capture_output=True, text=True)
    return [int(line) for line in found.stdout.split()]


def test_images_of_a_frame_share_stamp_frame_and_intrinsics(ros, place_camera):
    place_camera()
    listeners = {
        topic: ros.listen(topic, Image if "info" not in topic else CameraInfo)
        for topic in (COLOUR, DEPTH, SEGMENTATION, COLOUR_INFO, DEPTH_INFO)
    }
    ros.simulator(world(ros), use_sim_time=True)
    for listener in listeners.values():
        listener.wait_for(20)
    shared = set.intersection(*(set(listener.stamps_ns) for listener in listeners.values()))
    assert len(shared) >= 10
    assert {message.header.frame_id for each in listeners.values() for message in each.messages} == {"rpbi/eye"}
    assert all(stamp % 10_000_000 == 0 for stamp in shared)  # stamps of ticks
    colour, depth, segmentation = (listeners[topic].messages[-1] for topic in (COLOUR, DEPTH, SEGMENTATION))
    assert [image.encoding for image in (colour, depth, segmentation)] == ["rgb8", "32FC1", "mono16"]
    assert {(image.width, image.height) for image in (colour, depth, segmentation)} == {(160, 120)}
    assert [image.step for image in (colour, depth, segmentation)] == [480, 640, 320]
    info = listeners[COLOUR_INFO].messages[-1]
    focal_px = 60.0 / math.tan(math.radians(25.0))
    assert info.K == pytest.approx([focal_px, 0, 79.5, 0, focal_px, 59.5, 0, 0, 1])
    assert info.P == pytest.approx([focal_px, 0, 79.5, 0, 0, focal_px, 59.5, 0, 0, 0, 1, 0])
    assert info.R == pytest.approx(np.eye(3).ravel())
    assert (info.distortion_model, info.D) == ("plumb_bob", (0.0,) * 5)
    floor_m = pixels(depth, np.float32)[2:10, 2:10]
    assert floor_m == pytest.approx(HEIGHT_M - 0.005, abs=1e-3)


def test_segmentation_of_what_is_not_there_is_65535(ros, place_camera):
    place_camera()
    segmentation = ros.listen(SEGMENTATION, Image)
    ros.simulator(world(ros, collision_objects=[], robots=[]), use_sim_time=True)
    image = pixels(segmentation.wait_for(3)[-1], np.uint16)
    assert image[0, 0] == 65535
    assert image[60, 80] == 0  # the box, the only body


def test_no_image_comes_before_the_camera_has_a_pose(ros, place_camera):
    colour = ros.listen(COLOUR, Image)
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    ros.simulator(world(ros), use_sim_time=True)
    joint_states.wait_for(100)
    assert not colour.messages
    place_camera()
    colour.wait_for(1)


def test_viewer_that_comes_late_to_a_world_that_stands_still_gets_its_image_and_nobody_sees_a_stamp_twice(
    ros, place_camera
):
    place_camera()
    first = ros.listen(DEPTH, Image)
    ros.simulator(world(ros, start_pybullet_after_initialization=False), use_sim_time=True)
    first.wait_for(1)
    late = ros.start(["rostopic", "echo", "-n", "1", f"{DEPTH}/header/stamp"])
    assert late.wait(20.0) == 0
    assert "nsecs:  10000000" in ros.output(late)
    ros.call("/rpbi/start", Trigger)
    first.wait_for(10)
    stamps_ns = first.stamps_ns
    assert stamps_ns == sorted(set(stamps_ns))


def test_killed_renderer_comes_back_and_no_joint_state_is_missing(ros, place_camera):
    place_camera()
    colour = ros.listen(COLOUR, Image)
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    simulator = ros.simulator(world(ros), use_sim_time=True)
    colour.wait_for(3)
    (killed,) = renderers(simulator)
    os.kill(killed, signal.SIGKILL)
    wait_until(lambda: renderers(simulator) not in ([], [killed]), "there is another renderer")
    before = len(colour.messages)
    colour.wait_for(before + 5)
    assert ros.output(simulator).count("ended with signal SIGKILL") == 1
    steps_ns = set(np.diff(joint_states.stamps_ns))
    assert steps_ns == {20_000_000}


def test_stopped_viewer_holds_up_neither_physics_nor_other_viewers(ros, place_camera):
    place_camera()
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    colour = ros.listen(COLOUR, Image)
    ros.simulator(world(ros, timeStep=0.002), use_sim_time=True)
    viewer = ros.start(["rostopic", "hz", COLOUR])
    wait_until(lambda: "average rate" in ros.output(viewer), "the other viewer sees images")
    os.killpg(viewer.pid, signal.SIGSTOP)
    try:
        count = len(colour.messages)
        colour.wait_for(count + 200, timeout_s=60.0)
    finally:
        os.killpg(viewer.pid, signal.SIGCONT)
    assert set(np.diff(joint_states.stamps_ns)) == {20_000_000}


def test_camera_follows_the_namespace_and_the_remappings_of_its_simulator(ros, place_camera):
    place_camera()
    rospy.set_param("/use_sim_time", True)
    rospy.set_param("/left/simulator/config", world(ros))
    node = ["rosrun", "ros_pybullet_interface", "ros_pybullet_interface_node.py", "__ns:=/left", "__name:=simulator"]
    ros.start([*node, "rpbi/camera/colour/image:=/seen"])
    ros.listen("/seen", Image).wait_for(2)
    ros.listen("/left/rpbi/camera/depth/image", Image).wait_for(2)
    publishers = dict(rosgraph.Master("/tests").getSystemState()[0])
    assert publishers["/seen"] == ["/left/simulator_camera"]


def test_renderer_ends_with_its_simulator_and_takes_leave_of_the_master(ros, place_camera):
    place_camera()
    simulator = ros.simulator(world(ros), use_sim_time=True)
    ros.listen(COLOUR, Image).wait_for(2)
    (renderer,) = renderers(simulator)
    os.killpg(simulator.pid, signal.SIGINT)
    simulator.wait(20.0)
    assert not os.path.exists(f"/proc/{renderer}/exe")
    publishers = dict(rosgraph.Master("/tests").getSystemState()[0])
    assert COLOUR not in publishers


def test_renderer_of_a_killed_simulator_ends_too(ros, place_camera):
    place_camera()
    simulator = ros.simulator(world(ros), use_sim_time=True)
    ros.listen(COLOUR, Image).wait_for(2)
    (renderer,) = renderers(simulator)
    os.kill(_node_process(simulator), signal.SIGKILL)
    wait_until(lambda: not os.path.exists(f"/proc/{renderer}/exe"), "the renderer has ended")
    end_s = time.monotonic() + 10.0
    while COLOUR in dict(rosgraph.Master("/tests").getSystemState()[0]) and time.monotonic() < end_s:
        time.sleep(0.1)
    assert COLOUR not in dict(rosgraph.Master("/tests").getSystemState()[0])


def _node_process(simulator):
    """Returns the process of the node itself, which `rosrun` may have started as a child."""
    with open(f"/proc/{simulator.pid}/task/{simulator.pid}/children") as file:
        children = [int(child) for child in file.read().split()]
    nodes = [child for child in children if child not in renderers(simulator)]
    return nodes[0] if nodes else simulator.pid
