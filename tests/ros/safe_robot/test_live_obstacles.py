"""Bodies around the robot, as the simulator's markers and TF tell of them."""

from __future__ import annotations

import math

import pytest
import rospy
import tf2_ros
from geometry_msgs.msg import Quaternion, TransformStamped
from guarded_arm import folding, guard_of
from node_world import publishing
from ros_system import wait_until
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from robot_model.geometry import Pose
from rpbi.bodies.visual_shapes import BodyShape, ShapeKind
from rpbi.ros.publishers.world_markers import deletion, shape_marker
from safe_robot.check import CheckContext
from safe_robot.ros.measurements import LiveObstacles

BASE = "rpbi/arm/base"
UPRIGHT = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
"""A quarter of a turn about z."""


@pytest.fixture
def around(ros):
    """What is around a robot that stands 1 m from the world's origin and looks along y."""
    base = TransformStamped(child_frame_id=BASE)
    base.header.frame_id, base.transform.translation.x = "rpbi/world", 1.0
    base.transform.rotation = Quaternion(*UPRIGHT)
    broadcaster = tf2_ros.StaticTransformBroadcaster()
    broadcaster.sendTransform(base)
    around = LiveObstacles(BASE, ["arm"], timeout_s=0.5)
    with publishing("rpbi/markers", MarkerArray) as markers:
        yield around, markers.publish
    around.close()
    broadcaster.pub_tf.unregister()


def marker(name: str, *position: float, frame: str = "rpbi/world") -> Marker:
    """Returns the marker of a box of 10 cm, as the simulator sends it."""
    shape = BodyShape(-1, "", ShapeKind.BOX, (0.1, 0.1, 0.1), Pose(), (1.0, 1.0, 1.0, 1.0))
    return shape_marker(name, 0, shape, frame, Pose(position))


def test_bodies_are_where_tf_has_them_until_they_go(around):
    around, publish = around
    assert around.obstacles is None
    publish([marker("arm", 1.0, 0.0, 0.0), marker("box", 1.0, 0.5, 0.2), marker("ball", 0.0, 0.0, 0.0)])
    wait_until(lambda: around.obstacles, "the bodies are known")
    found = {each.name: each for each in around.obstacles}
    assert sorted(found) == ["ball", "box"]
    assert found["box"].pose.position == pytest.approx((0.5, 0.0, 0.2))
    assert (found["box"].kind, found["box"].size) == ("box", (0.1, 0.1, 0.1))
    same = around.obstacles
    publish([deletion(marker("ball")), marker("box", 1.0, 0.5, 0.2)])
    wait_until(lambda: around.obstacles is not same, "one has gone")
    assert [each.name for each in around.obstacles] == ["box"]


@pytest.mark.parametrize(("y", "is_in_the_way"), [(0.9, True), (5.0, False)])
def test_arm_avoids_obstacles_and_waits_while_they_are_unknown(around, tmp_path, y, is_in_the_way):
    around, publish = around
    guard = guard_of(folding(tmp_path), policy="reject", checks={"environment": {"margin_m": 0.05}})
    assert guard.decide((0.0, 0.0), CheckContext(obstacles=None)).command is None
    publish([marker("box", 1.0, y, 0.12)])  # with 0.9 m above the lower arm, 0.04 m off
    wait_until(lambda: around.obstacles, "the body is known")
    guard.decide((0.1, 0.0), CheckContext(obstacles=around.obstacles))
    assert not guard.is_halted
    for k in range(1, 201):
        t = k / 200.0
        upwards = 0.1 - 0.2 * t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
        if (decision := guard.decide((upwards, 0.0), CheckContext(obstacles=around.obstacles))).is_halted:
            break
    assert guard.is_halted == is_in_the_way
    if is_in_the_way:
        assert decision.violation.check == "environment" and "'box'" in str(decision.violation)
    publish([marker("box", 0.0, 0.0, 0.0, frame="nobody/knows")])
    wait_until(lambda: around.obstacles is None, "it is not known any more where it is")


@pytest.mark.parametrize(("timeout_s", "known"), [(0.5, False), (1e6, True)])
def test_places_older_than_the_timeout_are_unknown(around, timeout_s, known):
    late = TransformStamped(child_frame_id="late")
    late.header.frame_id, late.header.stamp = "rpbi/world", rospy.Time.now() - rospy.Duration(5.0)
    late.transform.rotation.w = 1.0
    _, publish = around
    patient = LiveObstacles(BASE, ["arm"], timeout_s)
    try:
        with publishing("/tf", TFMessage) as tf:
            tf.publish([late])
            publish([marker("box", 0.0, 0.0, 0.0)])
            wait_until(lambda: patient.obstacles, "a body that does not move is known")
            publish([marker("ball", 0.0, 0.0, 0.0, frame="late")])
            wait_until(lambda: len(patient.obstacles) == 2 if known else patient.obstacles is None, "it is looked at")
    finally:
        patient.close()
