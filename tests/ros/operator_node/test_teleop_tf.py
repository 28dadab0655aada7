"""`teleop_tf_node.py`: a frame that a person moves."""

from __future__ import annotations

import math
import time
from typing import Any

import pytest
import rospy
from custom_srvs.srv import SetTransform
from geometry_msgs.msg import Quaternion, Transform, Vector3
from node_world import Rosout, count_taken, publishing
from ros_system import wait_until
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger
from teleop.srv import GetBoxLimits
from tf2_msgs.msg import TFMessage

FRAMES = {"target_frame_id": "target", "parent_frame_id": "start"}
NO_TURN = Quaternion(0.0, 0.0, 0.0, 1.0)


class Frame:
    """Where the frame has been said to be."""

    def __init__(self, ros: Any) -> None:
        self._heard = ros.listen("/tf", TFMessage)

    def wait(self) -> None:
        """Waits until what is said would be heard."""
        wait_until(lambda: self._heard.is_connected, "the frame would be heard of")

    @property
    def transforms(self) -> list[Transform]:
        found = [each for message in list(self._heard.messages) for each in message.transforms]
        return [each.transform for each in found if (each.header.frame_id, each.child_frame_id) == ("start", "target")]

    @property
    def positions(self) -> list[tuple[float, float, float]]:
        return [(each.translation.x, each.translation.y, each.translation.z) for each in self.transforms]


def start(ros, start_on_init: bool = True, timeout_s: float = 0.5, **config: Any) -> Frame:
    parameters = {"config": {**FRAMES, **config}, "start_on_init": start_on_init, "input_timeout_s": timeout_s}
    rospy.set_param("/teleop_tf_node", parameters)
    frame = Frame(ros)
    ros.start(["rosrun", "teleop", "teleop_tf_node.py"])
    rospy.wait_for_service("teleop_box_limits", timeout=60.0)
    frame.wait()
    return frame


def held(signal: rospy.Publisher, values: list[float], condition: Any, what: str) -> None:
    """Repeats a signal until a condition holds."""
    wait_until(lambda: signal.publish(Float64MultiArray(data=values)) or condition(), what)


@pytest.mark.quick
def test_frame_moves_only_while_a_signal_is_received(ros):
    rosout = Rosout(ros)
    frame = start(ros, timeout_s=0.2)
    wait_until(lambda: frame.positions, "it is broadcast where it starts")
    assert frame.positions[0] == (0.0, 0.0, 0.0)
    with publishing("operator_node/signal", Float64MultiArray) as signal:
        held(signal, [0.5, 0.0, 0.0, 0.0, 0.0, 1.0], lambda: frame.positions[-1][0] > 0.1, "it moves")
        rosout.wait_for(["/operator_node/signal: no message for 0.2 s: the frame does not move"])
        wait_until(lambda: len(frame.positions) > 20 and len(set(frame.positions[-20:])) == 1, "it stands still")
        x = frame.positions[-1][0]
        assert 0.1 < x and frame.transforms[-1].rotation.z > 0.0
        held(signal, [0.0, 0.5, 0.0], lambda: frame.positions[-1][1] > 0.1, "it goes on from there")
        assert frame.positions[-1][0] == x


def test_frame_stops_when_the_operator_node_ends_without_timeout(ros):
    frame = start(ros, timeout_s=0.0)
    with publishing("operator_node/signal", Float64MultiArray) as signal:
        wait_until(lambda: frame.positions, "it is broadcast")
        signal.publish(Float64MultiArray(data=[0.1, 0.0, 0.0]))
        wait_until(lambda: frame.positions[-1][0] > 0.05, "one signal is enough")
    wait_until(lambda: len(set(frame.positions[-20:])) == 1, "it stands still")


def test_it_is_switched_and_reset_and_stays_within_its_box(ros):
    rosout = Rosout(ros)
    frame = start(ros, start_on_init=False, xlim=[-0.1, 0.2], ylim=[-1, 1])
    limits = ros.call("teleop_box_limits", GetBoxLimits)
    inf = math.inf
    assert (limits.xlim, limits.ylim, limits.zlim) == ((-0.1, 0.2), (-1.0, 1.0), (-inf, inf)), "each axis its own"

    answer = ros.call("reset_teleop_transform", SetTransform, Transform(Vector3(0.1, 0.5, 3.0), NO_TURN))
    assert (answer.success, answer.message) == (True, "transform set")
    wait_until(lambda: frame.positions == [(0.1, 0.5, 3.0)], "it is broadcast once, while it is off")
    with publishing("operator_node/signal", Float64MultiArray) as signal:
        for _ in range(5):
            signal.publish(Float64MultiArray(data=[0.0, 1.0, 0.0]))
        wait_until(lambda: count_taken(signal) == 5, "it has taken them")
        assert ros.call("toggle_teleop_tf", SetBool, True).success
        wait_until(lambda: len(frame.positions) > 10, "it is broadcast")
        assert set(frame.positions) == {(0.1, 0.5, 3.0)}, "what came while it was off counts for nothing"
        held(signal, [2.0, 0.0, 0.0], lambda: frame.positions[-1][0] == 0.2, "it goes to the wall of its box")
        held(signal, [1.0, 0.0, -9.0], lambda: rosout.logs("the signal is reduced to max_speed 2 m/s"), "it is slowed")
        for data in ([1.0], [math.nan, 0.0, 0.0]):
            held(signal, data, lambda: rosout.logs("message refused, and the frame does not move"), "it is refused")
        assert ros.call("toggle_teleop_tf", SetBool, False).message == "teleoperation is off"
    assert max(x for x, _, _ in frame.positions) == 0.2

    for transform, told in (
        (Transform(Vector3(0.3, 0.0, 0.0), NO_TURN), "x must be within -0.1 and 0.2 m, got 0.3"),
        (Transform(Vector3(0.0, math.nan, 0.0), NO_TURN), "must be finite"),
        (Transform(Vector3(0.0, 0.0, 0.0), Quaternion(0, 0, 0, 0)), "must not be zero"),
    ):
        answer = ros.call("reset_teleop_transform", SetTransform, transform)
        assert not answer.success and told in answer.message
    assert ros.call("reset_teleop_transform_to_zero", Trigger).success
    wait_until(lambda: frame.positions[-1] == (0.0, 0.0, 0.0), "it is back")


def test_in_ros_time_it_moves_as_slowly_as_the_world(ros):
    """0.5 s of simulated time take more than 2.5 s; the first step may be two periods long."""
    rospy.set_param("/use_sim_time", True)
    frame = start(ros, ros_time=True)
    with publishing("/clock", Clock) as clock, publishing("/operator_node/signal", Float64MultiArray) as signal:
        for tick in range(501):
            signal.publish(Float64MultiArray(data=[1.0, 0.0, 0.0]))
            clock.publish(Clock(rospy.Time.from_sec(10.0 + 0.001 * tick)))
            time.sleep(0.005)
        signal.publish(Float64MultiArray(data=[0.0, 0.0, 0.0]))
    assert 0.1 < max(x for x, _, _ in frame.positions) <= 0.5 + 0.02 + 1e-6
