"""What RViz is shown of the guard: lines where things are near, with how near, and the boxes of links."""

from __future__ import annotations

from threading import Condition

import pytest
from guarded_arm import decide, folding, guard_of
from ros_system import wait_until
from visualization_msgs.msg import Marker, MarkerArray

from safe_robot.ros.guard_markers import TOO_NEAR, GuardMarkers


def test_lines_have_the_stated_length_and_are_red_when_short(ros, tmp_path):
    checks = {"self_collision": {"margin_m": 0.02}, "link_box": {"boxes": {"lower": {"x": [-0.5, 0.5]}}}}
    guard = guard_of(folding(tmp_path), checks=checks)
    decide(guard, (0.0, 2.6))  # the elbow is folded: the lower arm is beside the base
    shown, boxes = ros.listen("/robot_safety/markers", MarkerArray), ros.listen("/safe_robot/box_limit/marker", Marker)
    markers = GuardMarkers(guard, Condition(), "base")
    message = wait_until(lambda: shown.messages[-1], "something is shown")
    alone = boxes.wait_for()[0]
    markers.close()
    lines = [each for each in message.markers if each.type == Marker.LINE_LIST]
    texts = [each.text for each in message.markers if each.type == Marker.TEXT_VIEW_FACING]
    assert lines and len(texts) == len(lines)
    for line, text in zip(lines, texts):
        first, second = line.points
        length_mm = 1e3 * sum((getattr(first, axis) - getattr(second, axis)) ** 2 for axis in "xyz") ** 0.5
        said_mm = float(text.split()[0])
        assert said_mm - 0.6 < length_mm < said_mm + 2.1, "what PyBullet may have measured too much is taken off"
        assert (line.color == TOO_NEAR) == (said_mm <= 40.0)
    (box,) = [each for each in message.markers if each.ns == "link_box"]
    assert box.scale.x == pytest.approx(1.0) and box.pose.position.x == pytest.approx(0.0)
    assert (alone.type, alone.pose, alone.scale) == (box.type, box.pose, box.scale), (
        "the release's README has its topic"
    )
    assert {each.header.frame_id for each in message.markers} == {"base"}
