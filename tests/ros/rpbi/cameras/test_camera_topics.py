"""What a camera publishes, as other nodes see it."""

from __future__ import annotations

import contextlib
import io
import math
import os
import re
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
import rosgraph
import rospy
from camera_world import CAMERA, HEIGHT_M, box_world, place, renderers
from PIL import Image as Picture
from ros_system import wait_until
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState
from std_srvs.srv import Trigger
from worlds import iiwa

COLOUR, DEPTH, SEGMENTATION = (f"/rpbi/camera/{suffix}" for suffix in ("colour/image", "depth/image", "segmentation"))
ROOT = Path(__file__).resolve().parents[4]
COLOUR_INFO, DEPTH_INFO = "/rpbi/camera/colour/camera_info", "/rpbi/camera/depth/camera_info"


def world(ros, **more):
    """Returns the main configuration of a box on a floor beside an arm, seen by a camera."""
    load = {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True, "basePosition": [0.8, 0.0, 0.0]}
    robots = [ros.write_yaml("iiwa.yaml", iiwa(loadURDF=load))]
    arm_and_camera = {"setAdditionalSearchPath": "pybullet_data_path", "robots": robots, "rgbd_sensor": CAMERA}
    return box_world(ros, **{**arm_and_camera, **more})


def pixels(message, dtype, channels=1):
    return np.frombuffer(message.data, dtype).reshape(message.height, message.width, channels).squeeze()


def test_images_of_a_frame_share_stamp_frame_and_intrinsics(ros, placed):
    listeners = {
        topic: ros.listen(topic, Image if "info" not in topic else CameraInfo)
        for topic in (COLOUR, DEPTH, SEGMENTATION, COLOUR_INFO, DEPTH_INFO)
    }
    ros.simulator(world(ros), use_sim_time=True)

    def shared_stamps():
        return set.intersection(*(set(listener.stamps_ns) for listener in listeners.values()))

    wait_until(lambda: len(shared_stamps()) >= 10, "ten frames have come")
    shared = shared_stamps()
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


def test_jpegs_are_the_colour_images_of_their_stamps_with_a_fraction_of_the_bytes(ros, placed):
    colour, jpeg = ros.listen(COLOUR, Image), ros.listen(f"{COLOUR}/compressed", CompressedImage)
    ros.simulator(world(ros), use_sim_time=True)
    wait_until(lambda: len(set(colour.stamps_ns) & set(jpeg.stamps_ns)) >= 5, "five images have come as both")
    raw = {image.header.stamp: pixels(image, np.uint8, 3) for image in list(colour.messages)}
    for image in [image for image in list(jpeg.messages) if image.header.stamp in raw]:
        assert (image.header.frame_id, image.format) == ("rpbi/eye", "rgb8; jpeg compressed bgr8")
        decoded = np.asarray(Picture.open(io.BytesIO(image.data)).convert("RGB"), float)
        assert np.abs(decoded - raw[image.header.stamp]).mean() < 3.0
        assert len(image.data) < raw[image.header.stamp].size / 5


def test_the_viewer_of_the_page_on_networks_shows_them(ros, placed):
    (block,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/network.md").read_text(), re.DOTALL)
    ros.simulator(world(ros), use_sim_time=True)
    viewer = ros.start([sys.executable, "-c", block])
    assert viewer.wait(60.0) == 0, ros.output(viewer)
    assert re.search(r"\(120, 160, 3\) \d+ bytes", ros.output(viewer))


def test_segmentation_of_what_is_not_there_is_65535(ros, placed):
    segmentation = ros.listen(SEGMENTATION, Image)
    ros.simulator(world(ros, collision_objects=[], robots=[], setGravity={"gravZ": 0.0}), use_sim_time=True)
    image = pixels(segmentation.wait_for(3)[-1], np.uint16)
    assert image[0, 0] == 65535
    assert image[60, 80] == 0  # the box, the only body


def test_no_image_comes_before_the_camera_has_a_pose(ros):
    colour = ros.listen(COLOUR, Image)
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    ros.simulator(world(ros), use_sim_time=True)
    joint_states.wait_for(100)
    assert not colour.messages
    with place("rpbi/eye"):
        colour.wait_for(1)


def test_viewer_that_comes_late_to_a_world_that_stands_still_gets_its_image_and_nobody_sees_a_stamp_twice(ros, placed):
    first = ros.listen(DEPTH, Image)
    ros.simulator(world(ros, start_pybullet_after_initialization=False), use_sim_time=True)
    first.wait_for(1)
    late = ros.start(["rostopic", "echo", "-n", "1", f"{DEPTH}/header/stamp"])
    assert late.wait(60.0) == 0
    assert "nsecs:  10000000" in ros.output(late)
    ros.call("/rpbi/start", Trigger)
    first.wait_for(10)
    stamps_ns = first.stamps_ns
    assert stamps_ns == sorted(set(stamps_ns))


def test_idle_renderer_that_is_killed_comes_back_and_no_joint_state_is_missing(ros, placed):
    colour = ros.listen(COLOUR, Image)
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    simulator = ros.simulator(world(ros), use_sim_time=True)
    colour.wait_for(3)
    (killed,) = renderers(simulator)
    policies = set()
    for thread in os.listdir(f"/proc/{killed}/task"):
        with contextlib.suppress(ProcessLookupError):  # one that has just ended
            policies.add(os.sched_getscheduler(int(thread)))
    if policies != {os.SCHED_IDLE}:  # physics goes first, unless others leave an idle process nothing
        wait_until(lambda: "runs at nice 19 instead of idle priority" in ros.output(simulator), "it was starved", 20.0)
    os.kill(killed, signal.SIGKILL)
    wait_until(lambda: renderers(simulator) not in ([], [killed]), "there is another renderer")
    before = len(colour.messages)
    colour.wait_for(before + 5)
    assert ros.output(simulator).count("ended with signal SIGKILL") == 1
    steps_ns = set(np.diff(joint_states.stamps_ns))
    assert steps_ns == {20_000_000}


def test_stopped_viewer_holds_up_neither_physics_nor_other_viewers(ros, placed):
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    colour = ros.listen(COLOUR, Image)
    large = {**CAMERA, "intrinsics": {**CAMERA["intrinsics"], "width": 640, "height": 480}}
    ros.simulator(world(ros, timeStep=0.002, rgbd_sensor=large), use_sim_time=True)
    viewer = ros.start(["rostopic", "hz", COLOUR])
    wait_until(lambda: "average rate" in ros.output(viewer), "the other viewer sees images")
    os.killpg(viewer.pid, signal.SIGSTOP)
    try:
        count = len(colour.messages)
        colour.wait_for(count + 20)  # 18 MB, more than sockets keep
    finally:
        os.killpg(viewer.pid, signal.SIGCONT)
    assert set(np.diff(joint_states.stamps_ns)) == {20_000_000}


def test_camera_follows_the_namespace_and_the_remappings_of_its_simulator(ros, placed):
    rospy.set_param("/use_sim_time", True)
    rospy.set_param("/left/simulator/config", world(ros))
    node = ["rosrun", "ros_pybullet_interface", "ros_pybullet_interface_node.py", "__ns:=/left", "__name:=simulator"]
    ros.start([*node, "rpbi/camera/colour/image:=/seen"])
    ros.listen("/seen", Image).wait_for(2)
    ros.listen("/left/rpbi/camera/depth/image", Image).wait_for(2)
    publishers = dict(rosgraph.Master("/tests").getSystemState()[0])
    assert publishers["/seen"] == ["/left/simulator_camera"]


def test_renderer_ends_with_its_simulator_and_takes_leave_of_the_master(ros, placed):
    simulator = ros.simulator(world(ros), use_sim_time=True)
    ros.listen(COLOUR, Image).wait_for(2)
    (renderer,) = renderers(simulator)
    os.killpg(simulator.pid, signal.SIGINT)
    simulator.wait(60.0)
    assert not os.path.exists(f"/proc/{renderer}/exe")
    publishers = dict(rosgraph.Master("/tests").getSystemState()[0])
    assert COLOUR not in publishers


def test_renderer_of_a_killed_simulator_ends_too(ros, placed):
    simulator = ros.simulator(world(ros), use_sim_time=True)
    ros.listen(COLOUR, Image).wait_for(2)
    (renderer,) = renderers(simulator)
    os.kill(_node_process(simulator), signal.SIGKILL)
    wait_until(lambda: not os.path.exists(f"/proc/{renderer}/exe"), "the renderer has ended")
    wait_until(lambda: COLOUR not in dict(rosgraph.Master("/tests").getSystemState()[0]), "its topics have gone")


def _node_process(simulator):
    """Returns the process of the node itself, which `rosrun` may have started as a child."""
    with open(f"/proc/{simulator.pid}/task/{simulator.pid}/children") as file:
        children = [int(child) for child in file.read().split()]
    nodes = [child for child in children if child not in renderers(simulator)]
    return nodes[0] if nodes else simulator.pid
