"""`planning_example.launch`, from its start until all boxes are in the other bookcase."""

from __future__ import annotations

import pytest
import rospy
import tf2_ros
from ros_system import RosSystem, wait_until

from rpbi_examples.shelving import LEFT, RIGHT

pytestmark = pytest.mark.thorough
BOXES = ("box_1", "box_2", "box_3")
SLOW_S = 500.0


def bookcase_of(buffer: tf2_ros.Buffer, box: str) -> str:
    """Returns the name of the bookcase in which a box is, empty if in none; nothing but the boards carries it there."""
    place = buffer.lookup_transform("rpbi/world", f"rpbi/{box}", rospy.Time(0)).transform.translation
    return next((each.name for each in (LEFT, RIGHT) if each.has((place.x, place.y, place.z))), "")


def test_all_boxes_come_into_the_other_bookcase(ros: RosSystem) -> None:
    buffer = ros.listen_to_tf()
    process = ros.start(["roslaunch", "rpbi_examples", "planning_example.launch", "headless:=true", "rounds:=1"])
    wait_until(lambda: buffer.can_transform("rpbi/world", "rpbi/box_3", rospy.Time(0)), "there are boxes")
    assert {bookcase_of(buffer, box) for box in BOXES} == {LEFT.name}
    wait_until(lambda: process.poll() is not None, "the round has ended", SLOW_S)
    output = ros.output(process)
    assert {bookcase_of(buffer, box) for box in BOXES} == {RIGHT.name}, output
    assert all(f"{box} is in 'right_shelf'" in output for box in BOXES), output
