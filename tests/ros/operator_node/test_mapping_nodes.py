"""`scale_node.py`, `isometric_node.py`, `mapping_node.py` and nodes of users': from `joy` to `operator_node/signal`."""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Iterator
from typing import Any

import pytest
import rospy
from node_world import Rosout, count_taken, publishing
from ros_system import Listener, stop_group, support_on_path, wait_until
from sensor_msgs.msg import Joy
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool

SIGNAL, TOGGLE = "operator_node/signal", "operator_node/toggle"
CONFIG = {"axes_idx": [1, 0], "scale": [0.5, -2.0]}


def start(ros, executable: str, *arguments: str, **parameters: Any) -> Any:
    """Starts a node with parameters under the name that it has by itself, and waits until it can be switched."""
    rospy.set_param("/operator_node", parameters)
    process = ros.start(["rosrun", "operator_node", executable, *arguments], **support_on_path())
    rospy.wait_for_service(TOGGLE, timeout=60.0)
    return process


@pytest.fixture(scope="class")
def scale_node(module_ros) -> Iterator[None]:
    """A scale node, switched on and with a time-out."""
    process = start(module_ros, "scale_node.py", config=CONFIG, start_on_init=True, input_timeout_s=0.3)
    yield
    stop_group(process)


@pytest.fixture
def signals(ros) -> Listener:
    return ros.listen(SIGNAL, Float64MultiArray)


@pytest.fixture
def joy(scale_node, signals) -> Iterator[rospy.Publisher]:
    """What the scale node listens to."""
    with publishing("joy", Joy) as publisher:
        yield publisher


def send(publisher: rospy.Publisher, signals: Listener, axes: list[float], expected: tuple[float, ...]) -> None:
    """Publishes a message, once, and waits for its signal."""
    wait_until(lambda: signals.is_connected, "the signal is heard")
    before = len(signals.messages)
    publisher.publish(Joy(axes=axes))
    wait_until(lambda: expected in data(signals)[before:], f"the signal is {expected}")


def data(signals: Listener) -> list[tuple[float, ...]]:
    return [message.data for message in list(signals.messages)]


def zeros(signals: Listener) -> int:
    return sum(not any(each) for each in data(signals))


def switch(ros, to: bool) -> tuple[bool, str]:
    answer = ros.call(TOGGLE, SetBool, to)
    return answer.success, answer.message


class TestScaleNode:
    @pytest.mark.quick
    def test_signal_is_held_and_input_that_ceases_is_one_zero(self, ros, joy, signals):
        rosout = Rosout(ros)
        for round_number in range(1, 4):
            send(joy, signals, [0.25, 1.0, 9.0], (0.5, -0.5))
            wait_until(lambda: data(signals)[-1] == (0.0, 0.0), "the signal ends")
            assert zeros(signals) == round_number, "exactly one for each time that input ceases"
        assert data(signals).count((0.5, -0.5)) > 3, "what is not zero is repeated while it is in force"
        assert set(data(signals)) == {(0.5, -0.5), (0.0, 0.0)}
        rosout.wait_for(["/joy: no message for 0.3 s: the signal is zero"])

    def test_switched_off_it_says_zero_once_and_then_nothing(self, ros, joy, signals):
        assert switch(ros, True) == (False, "operator node is already on")
        send(joy, signals, [0.5, 0.0], (0.0, -1.0))
        assert switch(ros, False) == (True, "operator node is off")
        wait_until(lambda: zeros(signals), "it says zero")
        said = len(signals.messages)
        taken = count_taken(joy)
        joy.publish(Joy(axes=[1.0, 1.0]))
        wait_until(lambda: count_taken(joy) > taken, "it has taken it")
        assert switch(ros, False) == (False, "operator node is already off")
        assert switch(ros, True) == (True, "operator node is on")
        send(joy, signals, [0.0, 1.0], (0.5, 0.0))
        assert [any(each) for each in data(signals)[:said]].count(False) == 1, "one zero signal"
        assert data(signals)[said] == (0.5, 0.0), "what came while it was off counts for nothing"

    def test_message_that_cannot_be_mapped_is_refused_with_zero_signal(self, ros, joy, signals):
        rosout = Rosout(ros)
        told = "/joy: message refused: expected at least 2 axes (axes_idx has 1), got 1"
        for axes in ([1.0], [1.0, math.nan]):
            send(joy, signals, [0.0, 0.0], (0.0, 0.0))  # which ends the last test's signal
            before = zeros(signals)
            send(joy, signals, [0.0, 1.0], (0.5, 0.0))
            for _ in range(20):
                joy.publish(Joy(axes=axes))
            wait_until(lambda: zeros(signals) > before, "the signal ends")  # noqa: B023 (it waits here)
        rosout.wait_for([told])
        assert zeros(signals) == before + 1 and all(math.isfinite(value) for each in data(signals) for value in each)
        assert rosout.logs("message refused")[0].msg == told
        assert rosout.is_throttled("message refused"), "one warning in 5 s, of 40 messages"


def test_device_that_reports_only_changes_counts_until_its_node_ends(ros, signals):
    """By default nothing times out; a node that is killed is noticed all the same."""
    start(ros, "isometric_node.py", config={"axes_idx": [0, 1], "scale": 0.5}, start_on_init=True)
    device = ros.start(["rostopic", "pub", "-l", "/joy", "sensor_msgs/Joy", "{axes: [1.0, 1.0]}"])
    held = 0.5 / math.sqrt(2.0)
    wait_until(lambda: len(signals.messages) >= 15, "it is repeated")
    assert all(each == pytest.approx((held, held)) for each in data(signals))
    os.killpg(device.pid, signal.SIGKILL)
    wait_until(lambda: data(signals)[-1] == (0.0, 0.0), "the signal ends")
    assert zeros(signals) == 1


def test_bad_configuration_ends_the_node_with_its_faults(ros):
    rospy.set_param("/operator_node", {"config": {"axes_idx": [0, -1], "scale": "fast"}})
    process = ros.start(["rosrun", "operator_node", "isometric_node.py"])
    assert process.wait(60.0) == 1
    for told in ("axes_idx[1]: must be >= 0, got -1", "scale: expected a number or a list of numbers, got text 'fast'"):
        assert f"~config: {told}" in ros.output(process)
    assert "Traceback" not in ros.output(process)


def test_ending_node_with_an_own_mapping_leaves_a_zero_signal(ros, signals):
    node = start(ros, "mapping_node.py", "cubed:Cubed", config={"axes_idx": [0]})
    assert switch(ros, True)[0]
    with publishing("joy", Joy) as joy:
        send(joy, signals, [0.0], (0.0,))
        send(joy, signals, [0.5], (0.125,))
        assert stop_group(node) == 0
        wait_until(lambda: zeros(signals) == 2, "it says zero")


def test_own_operator_node_works_as_in_the_release(ros, signals):
    rosout = Rosout(ros)
    rospy.set_param("/operator_node", {"config": {"gain": 2.0}, "start_on_init": True})
    node = ros.start_program("polar_node.py")
    with publishing("joy", Joy) as joy:
        send(joy, signals, [0.0, 0.5], (1.0, math.pi / 2.0))
        joy.publish(Joy(axes=[0.0, 0.5], buttons=[1]))
        rosout.wait_for(["/joy: message refused: ZeroDivisionError"])
        wait_until(lambda: data(signals)[-1] == (0.0, 0.0), "an error in it ends the signal")
    assert stop_group(node) == 0
