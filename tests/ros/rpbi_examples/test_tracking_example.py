"""The example in which Vicon sees a box of one world and a second world follows, as a user launches it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from apriltag_ros.msg import AprilTagDetectionArray
from geometry_msgs.msg import TransformStamped
from node_world import Rosout
from ros_system import wait_until
from tf2_msgs.msg import TFMessage

SLOW_S = 120.0
CARRIED_Z = 0.3
"""Height at which the box is carried [m]."""


def frames(tf, parent, child, since_s=0.0):
    """Returns the translations of a frame on TF so far, from a time on [s]."""
    return [
        one.transform.translation
        for message in list(tf.messages)
        for one in message.transforms
        if (one.header.frame_id, one.child_frame_id) == (parent, child) and one.header.stamp.to_sec() >= since_s
    ]


@pytest.mark.thorough
@pytest.mark.quick
def test_twin_follows_a_box_seen_by_vicon_else_drops_it(ros):
    ros.start(["roslaunch", "rpbi_examples", "tracking_example.launch", "headless:=true"])
    tf = ros.listen("/tf", TFMessage)
    vicon = ros.listen("/lab/vicon/box/box", TransformStamped)
    rosout = Rosout(ros)

    def twins():
        return frames(tf, "twin/rpbi/world", "twin/rpbi/box")

    wait_until(lambda: any(abs(p.z - CARRIED_Z) < 0.02 for p in twins()[1:]), "the twin lifts the box", SLOW_S)
    outliers = len(rosout.logs("left out: outlier"))  # the box jumps to the hand that carries it, if that comes late
    wait_until(lambda: rosout.logs("box/pose: TF of 'tracked/box' is stale"), "the box is hidden", SLOW_S)
    wait_until(lambda: twins()[-1].z < 0.06, "physics has it fall on the floor", SLOW_S)
    wait_until(lambda: rosout.logs("box/pose: TF of 'tracked/box' comes again"), "it is seen again", SLOW_S)
    wait_until(lambda: abs(twins()[-1].z - CARRIED_Z) < 0.02, "it is carried again", SLOW_S)
    assert rosout.logs("tracked/box: is lost: no pose for 0.5 s")
    assert len(rosout.logs("left out: outlier")) == outliers, "none when it is seen again"

    seen = vicon.messages[0]
    assert (seen.header.frame_id, seen.child_frame_id) == ("lab/rpbi/world", "lab/vicon/box/box")
    assert frames(tf, "lab/rpbi/world", "lab/vicon/box/box"), "on TF too"
    path = [message.transform.translation for message in vicon.messages]
    since_s = seen.header.stamp.to_sec()  # TF may be heard before
    tracked = frames(tf, "twin/rpbi/world", "tracked/box", since_s)
    assert tracked and all(min(math.dist((p.x, p.y), (q.x, q.y)) for q in path) < 0.02 for p in tracked[::20])


@pytest.mark.thorough
def test_twin_follows_the_tag_detected_by_a_camera(ros):
    ros.start(["roslaunch", "rpbi_examples", "tracking_example.launch", "headless:=true", "tracker:=april_tags"])
    tf = ros.listen("/tf", TFMessage)
    seen = ros.listen("/lab/tag_detections", AprilTagDetectionArray)
    wait_until(lambda: any(each.detections for each in seen.messages), "the tag is detected", SLOW_S)

    def lifted():
        return [p for p in frames(tf, "twin/rpbi/world", "twin/rpbi/box")[1:] if abs(p.z - CARRIED_Z) < 0.02]

    wait_until(lambda: len(lifted()) > 20, "the twin lifts the box", SLOW_S)
    path = frames(tf, "lab/figure_eight_base", "lab/figure_eight")
    assert all(min(math.dist((p.x, p.y), (q.x, q.y)) for q in path) < 0.03 for p in lifted()[10::5])


@pytest.mark.thorough
def test_twin_follows_the_tag_found_in_images(ros):
    """Beside the camera there is Vicon, whose poses are the simulator's but for 0.5 mm and 3 mrad."""
    arguments = ("headless:=true", "tracker:=april_tags", "images:=true")
    tf = ros.listen("/tf", TFMessage)
    seen = ros.listen("/lab/tag_detections", AprilTagDetectionArray)
    vicon = ros.listen("/lab/vicon/box/box", TransformStamped)
    ros.start(["roslaunch", "rpbi_examples", "tracking_example.launch", *arguments])

    def compared():
        """Returns the detections that Vicon has poses before and after, each with the box's place at its stamp."""
        truth = list(vicon.messages)
        times_s = [each.header.stamp.to_sec() for each in truth]
        places = np.array([[getattr(each.transform.translation, axis) for axis in "xyz"] for each in truth])
        found = [one for each in seen.messages for one in each.detections]
        for one in found:
            stamp_s = one.pose.header.stamp.to_sec()
            after = int(np.searchsorted(times_s, stamp_s))
            if 0 < after < len(times_s) and times_s[after] - times_s[after - 1] < 0.05:
                yield one, [np.interp(stamp_s, times_s, axis) for axis in places.T]

    pairs = wait_until(lambda: len(pairs := list(compared())) >= 5 and pairs, "the tag is found", SLOW_S, every_s=0.5)
    for one, (x, y, z) in pairs:
        assert (one.id, one.size, one.pose.header.frame_id) == ((7,), (0.1,), "lab/rpbi/eye")
        position, quat = one.pose.pose.pose.position, one.pose.pose.pose.orientation
        assert math.dist((position.x, position.y), (x, -y)) < 0.007, "the camera is above the origin"
        assert abs(position.z - (0.9 - z - 0.05)) < 0.01, "along the line of sight"
        assert abs(quat.x) > math.cos(0.05), "the tag faces the camera, turned as it is"
        assert set(one.pose.pose.covariance) == {0.0}
    assert frames(tf, "lab/rpbi/eye", "lab/tag"), "on TF too"

    def follows():
        newest = frames(tf, "twin/rpbi/world", "twin/rpbi/box")[-1]
        return abs(newest.z - CARRIED_Z) < 0.03 and abs(newest.x) < 0.13 and abs(newest.y) < 0.23

    wait_until(follows, "the twin has the box", SLOW_S)
