"""A stick that is pushed diagonally moves the target of `teleop` and `lfd` as fast as one along an axis."""

from __future__ import annotations

import math

import numpy as np
import pytest
import rospy
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import Joy
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool

FRAMES = ("rpbi/teleop_origin", "rpbi/teleop_target")
DEVICE = {"teleop": "device:=joystick", "lfd": "operator:=joystick"}
SPEED = 0.1


@pytest.mark.parametrize("example", ["teleop", pytest.param("lfd", marks=pytest.mark.thorough)])
@pytest.mark.parametrize(
    ("mapping", "factor"),
    [("", 1.0), pytest.param("mapping:=scale", math.sqrt(2.0), marks=pytest.mark.thorough)],
)
def test_diagonal_has_the_speed_of_an_axis(ros: RosSystem, tmp_path, example: str, mapping: str, factor: float) -> None:
    arguments = [DEVICE[example], "virtual:=true", "headless:=true", f"speed:={SPEED}", *filter(None, [mapping])]
    folder = [f"out:={tmp_path}"] if example == "lfd" else []
    ros.start(["roslaunch", "rpbi_examples", f"{example}.launch", *arguments, *folder])
    signals, tf = ros.listen("operator_node/signal", Float64MultiArray), ros.listen_to_tf()
    joy = ros.listen("joy", Joy)
    stick = rospy.Publisher("joy/virtual", Joy, queue_size=10)

    def push(right: float, away: float) -> None:
        stick.publish(Joy(axes=[-right, away, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0], buttons=[0] * 11))

    def position() -> np.ndarray:
        found = tf.lookup_transform(*FRAMES, rospy.Time(0)).transform.translation
        return np.array([found.x, found.y])

    def speed(right: float, away: float) -> float:
        """Pushes the stick until the target has gone 2 cm in that direction, and returns the length of the signal."""
        direction = np.array([right, away]) / math.hypot(right, away)
        begin, start = position(), len(signals.messages)
        wait_until(lambda: push(right, away) or (position() - begin) @ direction > 0.02, "the target moves")
        largest: float = max(np.linalg.norm(each.data) for each in signals.messages[start:])
        wait_until(lambda: push(0.0, 0.0) or not any(signals.messages[-1].data), "the stick is at rest")
        return largest

    wait_until(lambda: push(0.0, 0.0) or joy.messages, "the stick has been at rest")
    wait_until(lambda: tf.can_transform(*FRAMES, rospy.Time(0)), "the target is broadcast")
    ros.call("toggle_teleop_tf", SetBool, True)  # the example would only do so when the arm is there
    assert speed(1.0, 0.0) == pytest.approx(SPEED, rel=0.01)
    assert speed(1.0, 1.0) == pytest.approx(factor * SPEED, rel=0.01)
    stick.unregister()
