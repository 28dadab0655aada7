"""Images of a camera as other nodes see them: at its start, with slow subscribers, and at its end."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest
import rosbag
import rosgraph
import rospy
from camera_world import CAMERA, COLOUR, DEPTH, SEGMENTATION, arm_world, pixels, place, renderers
from ros_system import wait_until
from sensor_msgs.msg import Image, JointState
from std_srvs.srv import Trigger

from rpbi_data import Recorder


def test_segmentation_of_empty_pixels_is_65535(ros, placed):
    segmentation = ros.listen(SEGMENTATION, Image)
    ros.simulator(arm_world(ros, collision_objects=[], robots=[], setGravity={"gravZ": 0.0}), use_sim_time=True)
    image = pixels(segmentation.wait_for(3)[-1], np.uint16)
    assert image[0, 0] == 65535
    assert image[60, 80] == 0  # the box, the only body


def test_no_image_comes_before_the_camera_has_a_pose(ros):
    colour = ros.listen(COLOUR, Image)
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    ros.simulator(arm_world(ros), use_sim_time=True)
    joint_states.wait_for(100)
    assert not colour.messages
    with place("rpbi/eye"):
        colour.wait_for(1)


def test_late_viewer_of_a_paused_world_receives_its_image_once(ros, placed):
    first = ros.listen(DEPTH, Image)
    ros.simulator(arm_world(ros, start_pybullet_after_initialization=False), use_sim_time=True)
    first.wait_for(1)
    late = ros.start(["rostopic", "echo", "-n", "1", f"{DEPTH}/header/stamp"])
    assert late.wait(60.0) == 0
    assert "nsecs:  10000000" in ros.output(late)
    ros.call("/rpbi/start", Trigger)
    first.wait_for(10)
    stamps_ns = first.stamps_ns
    assert stamps_ns == sorted(set(stamps_ns))


@pytest.mark.thorough
def test_stopped_viewer_holds_up_neither_physics_nor_other_viewers(ros, placed):
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    colour = ros.listen(COLOUR, Image)
    large = {**CAMERA, "intrinsics": {**CAMERA["intrinsics"], "width": 640, "height": 480}}
    ros.simulator(arm_world(ros, timeStep=0.002, rgbd_sensor=large), use_sim_time=True)
    viewer = ros.start(["rostopic", "hz", COLOUR])
    wait_until(lambda: "average rate" in ros.output(viewer), "the other viewer sees images")
    os.killpg(viewer.pid, signal.SIGSTOP)
    try:
        count = len(colour.messages)
        colour.wait_for(count + 20, 400.0)  # 18 MB, more than sockets keep; beside load, the renderer hardly runs
    finally:
        os.killpg(viewer.pid, signal.SIGCONT)
    assert set(np.diff(joint_states.stamps_ns)) == {20_000_000}


@pytest.mark.thorough
def test_camera_follows_the_namespace_and_the_remappings_of_its_simulator(ros, placed):
    rospy.set_param("/use_sim_time", True)
    rospy.set_param("/left/simulator/config", arm_world(ros))
    node = ["rosrun", "ros_pybullet_interface", "ros_pybullet_interface_node.py", "__ns:=/left", "__name:=simulator"]
    ros.start([*node, "rpbi/camera/colour/image:=/seen"])
    ros.listen("/seen", Image).wait_for(2)
    ros.listen("/left/rpbi/camera/depth/image", Image).wait_for(2)
    publishers = dict(rosgraph.Master("/tests").getSystemState()[0])
    assert publishers["/seen"] == ["/left/simulator_camera"]


def test_renderer_ends_with_its_simulator_and_unregisters(ros, placed):
    simulator = ros.simulator(arm_world(ros), use_sim_time=True)
    ros.listen(COLOUR, Image).wait_for(2)
    (renderer,) = renderers(simulator)
    os.killpg(simulator.pid, signal.SIGINT)
    simulator.wait(60.0)
    assert not os.path.exists(f"/proc/{renderer}/exe")
    publishers = dict(rosgraph.Master("/tests").getSystemState()[0])
    assert COLOUR not in publishers


def test_renderer_of_a_killed_simulator_ends_too(ros, placed):
    simulator = ros.simulator(arm_world(ros), use_sim_time=True)
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


@pytest.mark.thorough
def test_paused_recorder_misses_no_image(ros, tmp_path, placed):
    """As many bytes come meanwhile as no socket takes; a viewer would be sent the newest two."""
    camera = {**CAMERA, "hz": 20, "intrinsics": {**CAMERA["intrinsics"], "width": 640, "height": 480}}
    ros.simulator(arm_world(ros, rgbd_sensor=camera))
    colour = ros.listen(COLOUR, Image)
    with Recorder(tmp_path / "a.bag", [COLOUR]) as recorder:
        colour.wait_for(3)
        recorder._process.send_signal(signal.SIGSTOP)
        colour.wait_for(len(colour.messages) + 30)
        recorder._process.send_signal(signal.SIGCONT)
        wait_until(lambda: recorder.published().get(COLOUR, 0) > 30, "they are sent")
    with rosbag.Bag(str(tmp_path / "a.bag")) as bag:
        numbers = [message.header.seq for _, message, _ in bag.read_messages()]
    assert len(numbers) > 30 and set(np.diff(numbers)) == {1}
