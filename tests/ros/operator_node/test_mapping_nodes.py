"""`scale_node.py`, `isometric_node.py`, `mapping_node.py` and nodes of users': from `joy` to `operator_node/signal`."""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Iterator
from typing import Any

import pytest
import rospy
from node_world import Rosout, publishing
from ros_system import Listener, stop_group, support_on_path, wait_until
from sensor_msgs.msg import Joy
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool

SIGNAL, TOGGLE = "operator_node/signal", "operator_node/toggle"
CONFIG = {"axes_idx": [1, 0], "scale": [0.5, -2.0]}


@pytest.fixture
def start(ros):
    """Starts a node with parameters under the name that it has by itself, and waits until it can be switched."""

    def run(executable: str, *arguments: str, environment: dict[str, str] | None = None, **parameters: Any) -> Any:
        rospy.set_param("/operator_node", parameters)
        process = ros.start(["rosrun", "operator_node", executable, *arguments], **(environment or {}))
        rospy.wait_for_service(TOGGLE, timeout=60.0)
        return process

    return run


@pytest.fixture
def signals(ros) -> Listener:
    return ros.listen(SIGNAL, Float64MultiArray)


@pytest.fixture
def joy(ros, start, signals) -> Iterator[rospy.Publisher]:
    """What a scale node, switched on and with a time-out, listens to."""
    start("scale_node.py", config=CONFIG, start_on_init=True, input_timeout_s=0.3)
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


@pytest.mark.quick
def test_signal_is_scaled_and_held_and_input_that_ceases_is_one_zero(ros, joy, signals):
    rosout = Rosout(ros)
    for round_number in range(1, 4):
        send(joy, signals, [0.25, 1.0, 9.0], (0.5, -0.5))
        wait_until(lambda: data(signals)[-1] == (0.0, 0.0), "the signal ends")
        assert zeros(signals) == round_number, "exactly one for each time that input ceases"
    assert data(signals).count((0.5, -0.5)) > 3, "what is not zero is repeated while it is in force"
    assert set(data(signals)) == {(0.5, -0.5), (0.0, 0.0)}
    rosout.wait_for(["/joy: nothing has come for 0.3 s: the signal is zero"])


def test_switched_off_it_says_zero_once_and_then_nothing(ros, joy, signals):
    assert switch(ros, True) == (False, "operator node is already on")
    send(joy, signals, [0.5, 0.0], (0.0, -1.0))
    assert switch(ros, False) == (True, "operator node is off")
    wait_until(lambda: zeros(signals), "it says zero")
    said = len(signals.messages)
    joy.publish(Joy(axes=[1.0, 1.0]))
    assert switch(ros, False) == (False, "operator node is already off")
    assert switch(ros, True) == (True, "operator node is on")
    send(joy, signals, [0.0, 1.0], (0.5, 0.0))
    assert zeros(signals) == 1 and (0.5, -2.0) not in data(signals), "what came while it was off counts for nothing"
    assert data(signals)[said] == (0.5, 0.0)


@pytest.mark.parametrize(
    ("axes", "told"),
    [
        ([1.0], "expected at least 2 axes (axes_idx has 1), got 1"),
        ([1.0, math.nan], "axes must be finite, got 1, nan"),
    ],
)
def test_message_that_cannot_be_mapped_is_refused_and_ends_the_signal(ros, joy, signals, axes, told):
    rosout = Rosout(ros)
    send(joy, signals, [0.0, 1.0], (0.5, 0.0))
    for _ in range(20):
        joy.publish(Joy(axes=axes))
    rosout.wait_for([told])
    send(joy, signals, [0.0, 0.5], (0.25, 0.0))
    assert zeros(signals) == 1
    assert [log.msg for log in rosout.logs(told)] == [f"/joy: message refused: {told}"], "once, not each time"
    assert all(math.isfinite(value) for each in data(signals) for value in each)


def test_device_that_tells_changes_only_counts_until_its_node_has_gone(ros, start, signals):
    """By default nothing times out; a node that is killed is noticed all the same."""
    start("isometric_node.py", config={"axes_idx": [0, 1], "scale": 0.5}, start_on_init=True)
    device = ros.start(["rostopic", "pub", "-l", "/joy", "sensor_msgs/Joy", "{axes: [1.0, 1.0]}"])
    held = 0.5 / math.sqrt(2.0)
    wait_until(lambda: len(signals.messages) >= 15, "it is repeated")
    assert all(each == pytest.approx((held, held)) for each in data(signals))
    os.killpg(device.pid, signal.SIGKILL)
    wait_until(lambda: data(signals)[-1] == (0.0, 0.0), "the signal ends")
    assert zeros(signals) == 1


def test_node_that_ends_leaves_a_zero_signal(ros, start, signals):
    node = start("scale_node.py", config=CONFIG, start_on_init=True)
    with publishing("joy", Joy) as joy:
        send(joy, signals, [0.0, 1.0], (0.5, 0.0))
        assert stop_group(node) == 0
        wait_until(lambda: zeros(signals) == 1, "it says zero")


@pytest.mark.parametrize(
    ("executable", "config", "told"),
    [
        ("scale_node.py", {"axes_idx": [0, -1]}, "~config: axes_idx[1]: must be >= 0, got -1"),
        ("isometric_node.py", {"axes_idx": [0], "scale": "fast"}, "~config: scale: expected a number, got text 'fast'"),
    ],
)
def test_bad_configuration_ends_the_node_with_what_is_wrong(ros, executable, config, told):
    rospy.set_param("/operator_node", {"config": config})
    process = ros.start(["rosrun", "operator_node", executable])
    assert process.wait(60.0) == 1
    assert told in ros.output(process) and "Traceback" not in ros.output(process)


def test_mapping_of_another_package(ros, start, signals):
    start("mapping_node.py", "dead_zone:DeadZone", environment=support_on_path(), config={"axes_idx": [0]})
    assert switch(ros, True)[0]
    with publishing("joy", Joy) as joy:
        send(joy, signals, [0.05], (0.0,))
        send(joy, signals, [0.5], (0.5,))


def test_operator_node_of_a_user_in_the_manner_of_the_release(ros, signals):
    rosout = Rosout(ros)
    rospy.set_param("/operator_node", {"config": {"gain": 2.0}, "start_on_init": True})
    node = ros.start_program("dead_zone.py")
    with publishing("joy", Joy) as joy:
        send(joy, signals, [0.0, 0.5], (1.0, math.pi / 2.0))
        joy.publish(Joy(axes=[0.0, 0.5], buttons=[1]))
        rosout.wait_for(["/joy: message refused: ZeroDivisionError"])
        wait_until(lambda: data(signals)[-1] == (0.0, 0.0), "an error in it ends the signal")
    assert stop_group(node) == 0
