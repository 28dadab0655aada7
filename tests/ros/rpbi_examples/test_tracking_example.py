"""The example in which Vicon sees a box of one world and a second world follows, as a user launches it."""

from __future__ import annotations

import math

import pytest
from apriltag_ros.msg import AprilTagDetectionArray
from geometry_msgs.msg import TransformStamped
from node_world import Rosout
from ros_system import RosSystem, wait_until
from tf2_msgs.msg import TFMessage

SLOW_S = 120.0
CARRIED_Z = 0.3
"""Height at which the box is carried [m]."""


@pytest.fixture(scope="module")
def example(ros_master, tmp_path_factory):
    system = RosSystem(tmp_path_factory.mktemp("tracking"))
    try:
        system.start(["roslaunch", "rpbi_examples", "tracking_example.launch", "headless:=true"])
        yield system
    finally:
        system.close()


def frames(tf, parent, child, since_s=0.0):
    """Returns the translations of a frame on TF so far, from a time on [s]."""
    return [
        one.transform.translation
        for message in list(tf.messages)
        for one in message.transforms
        if (one.header.frame_id, one.child_frame_id) == (parent, child) and one.header.stamp.to_sec() >= since_s
    ]


@pytest.mark.quick
def test_the_twin_has_the_box_where_vicon_sees_it_and_drops_it_where_it_does_not(example):
    tf = example.listen("/tf", TFMessage)
    vicon = example.listen("/lab/vicon/box/box", TransformStamped)
    rosout = Rosout(example)

    def twins():
        return frames(tf, "twin/rpbi/world", "twin/rpbi/box")

    wait_until(lambda: any(abs(p.z - CARRIED_Z) < 0.02 for p in twins()[1:]), "the twin lifts the box", SLOW_S)
    wait_until(lambda: rosout.logs("box/pose: TF of 'tracked/box' is stale"), "the box is hidden", SLOW_S)
    wait_until(lambda: twins()[-1].z < 0.06, "physics has it fall on the floor", SLOW_S)
    wait_until(lambda: rosout.logs("box/pose: TF of 'tracked/box' comes again"), "it is seen again", SLOW_S)
    wait_until(lambda: abs(twins()[-1].z - CARRIED_Z) < 0.02, "it is carried again", SLOW_S)
    assert rosout.logs("tracked/box: is lost: no pose for 0.5 s") and not rosout.logs("left out")

    seen = vicon.messages[0]
    assert (seen.header.frame_id, seen.child_frame_id) == ("lab/rpbi/world", "lab/vicon/box/box")
    assert frames(tf, "lab/rpbi/world", "lab/vicon/box/box"), "on TF too"
    path = [message.transform.translation for message in vicon.messages]
    since_s = seen.header.stamp.to_sec()  # TF may be heard before
    tracked = frames(tf, "twin/rpbi/world", "tracked/box", since_s)
    assert tracked and all(min(math.dist((p.x, p.y), (q.x, q.y)) for q in path) < 0.02 for p in tracked[::20])


def test_the_twin_has_the_box_where_a_camera_detects_its_tag(ros):
    ros.start(["roslaunch", "rpbi_examples", "tracking_example.launch", "headless:=true", "tracker:=april_tags"])
    tf = ros.listen("/tf", TFMessage)
    seen = ros.listen("/lab/tag_detections", AprilTagDetectionArray)
    wait_until(lambda: any(each.detections for each in seen.messages), "the tag is detected", SLOW_S)

    def lifted():
        return [p for p in frames(tf, "twin/rpbi/world", "twin/rpbi/box")[1:] if abs(p.z - CARRIED_Z) < 0.02]

    wait_until(lambda: len(lifted()) > 20, "the twin lifts the box", SLOW_S)
    path = frames(tf, "lab/figure_eight_base", "lab/figure_eight")
    assert all(min(math.dist((p.x, p.y), (q.x, q.y)) for q in path) < 0.03 for p in lifted()[10::5])
