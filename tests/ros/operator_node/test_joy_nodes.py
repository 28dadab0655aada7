"""`keyboard_to_joy.py`, `joy_remap` and the interface logger, under all their names."""

from __future__ import annotations

import math

import rospy
from keyboard.msg import Key
from node_world import Rosout, publishing
from ros_system import wait_until
from sensor_msgs.msg import Joy
from std_msgs.msg import Float64MultiArray, Header

from operator_node.parser import reconstruct_interface_log_msg

KEYS = {"axes": [["LEFT", "RIGHT"], ["DOWN", "UP"], ["b", "f"]], "buttons": [1, "2", "SPACE"]}
STILL = ((0.0, 0.0, 0.0), (0, 0, 0))


def states(joy) -> list[tuple[tuple[float, ...], tuple[int, ...]]]:
    """Returns axes and buttons, those that repeat the one before left out."""
    said = [(message.axes, message.buttons) for message in list(joy.messages)]
    return [each for number, each in enumerate(said) if number == 0 or each != said[number - 1]]


def start_keyboard(ros, **parameters):
    rospy.set_param("/keyboard_to_joy", {"config": KEYS, **parameters})
    ros.start(["rosrun", "operator_node", "keyboard_to_joy.py"])
    joy = ros.listen("joy", Joy)
    joy.wait_for()
    return joy


def test_axes_and_buttons_follow_the_keys_that_are_held(ros):
    """Defect 42: the release counts ups and downs, so that one that is lost or repeated leaves an axis stuck."""
    joy = start_keyboard(ros)
    with publishing("keyboard/keydown", Key) as down, publishing("keyboard/keyup", Key) as up:

        def press(publisher, code, axes, buttons=(0, 0, 0)):
            publisher.publish(Key(code=code))
            wait_until(lambda: states(joy)[-1] == (axes, buttons), f"{code} is told")

        press(down, Key.KEY_1, (0.0, 0.0, 0.0), (1, 0, 0))
        up.publish(Key(code=Key.KEY_RIGHT))  # it was held before the node began
        up.publish(Key(Header(stamp=rospy.Time(5)), Key.KEY_UP, 0))
        press(up, Key.KEY_1, (0.0, 0.0, 0.0))
        down.publish(Key(Header(stamp=rospy.Time(4)), Key.KEY_UP, 0))  # it comes after its release
        for _ in range(3):
            press(down, Key.KEY_RIGHT, (1.0, 0.0, 0.0))
        press(down, Key.KEY_LEFT, (0.0, 0.0, 0.0))
        press(up, Key.KEY_RIGHT, (-1.0, 0.0, 0.0))
        press(down, Key.KEY_f, (-1.0, 0.0, 1.0))
        press(down, Key.KEY_1, (-1.0, 0.0, 1.0), (1, 0, 0))
        press(down, Key.KEY_SPACE, (-1.0, 0.0, 1.0), (1, 0, 1))
        press(down, Key.KEY_z, (-1.0, 0.0, 1.0), (1, 0, 1))
        press(up, Key.KEY_LEFT, (0.0, 0.0, 1.0), (1, 0, 1))
    wait_until(lambda: states(joy)[-1] == STILL, "the keyboard has gone, and all keys are released")
    assert all(axes[1] == 0.0 for axes, _ in states(joy)), "a press that comes after its release counts for nothing"
    assert joy.messages[-1].header.frame_id == "keyboard" and joy.stamps_ns == sorted(set(joy.stamps_ns))


def test_key_whose_release_is_lost_is_released_after_a_time(ros):
    joy = start_keyboard(ros, key_timeout_s=0.2)
    with publishing("keyboard/keydown", Key) as down:
        down.publish(Key(code=Key.KEY_UP))
        wait_until(lambda: len(states(joy)) == 3, "the key is held, and then is not")
    assert states(joy) == [STILL, ((0.0, 1.0, 0.0), (0, 0, 0)), STILL]


def test_joy_is_repeated_with_new_stamps_until_input_ceases(ros):
    rospy.set_param("/joy_remap", {"hz": 50})
    ros.start(["rosrun", "operator_node", "joy_remap"])
    out = ros.listen("joy_out", Joy)
    with publishing("joy_in", Joy) as device:
        assert not out.messages, "nothing before the first message"
        message = Joy(axes=[0.5, -1.0], buttons=[1])
        message.header.frame_id, message.header.stamp = "stick", rospy.Time(12)
        device.publish(message)
        out.wait_for(10)
        device.publish(Joy(message.header, [math.nan, 0.1], [1]))
        wait_until(lambda: states(out)[-1] == ((0.0, 0.0), (0,)), "what is not finite ends it")
        device.publish(message)
        wait_until(lambda: states(out)[-1] == ((0.5, -1.0), (1,)), "what makes sense counts again")
        assert all(math.isfinite(sum(axes)) for axes, _ in states(out))
    wait_until(lambda: states(out)[-1] == ((0.0, 0.0), (0,)), "the device has gone")
    assert states(out) == [((0.5, -1.0), (1,)), ((0.0, 0.0), (0,))] * 2
    assert [each.axes for each in out.messages].count((0.0, 0.0)) == 2, "one for each"
    assert out.stamps_ns == sorted(set(out.stamps_ns)) and out.stamps_ns[0] > 12e9
    assert {each.header.frame_id for each in out.messages} == {"stick"}


def test_window_has_each_signal_of_its_duration(ros):
    rosout = Rosout(ros)
    rospy.set_param("/operator_interface_logger", {"window_duration": 1000.0})
    ros.start(["rosrun", "operator_node", "operator_interface_logger"])
    windows = ros.listen("operator_node/window", Float64MultiArray)
    with publishing("operator_node/signal", Float64MultiArray) as signal:
        wait_until(lambda: windows.is_connected, "the window is heard")
        before_s = rospy.Time.now().to_sec()
        for number in range(5):
            signal.publish(Float64MultiArray(data=[number, -number]))
            windows.wait_for(number + 1)
        after_s = rospy.Time.now().to_sec()
        signal.publish(Float64MultiArray(data=[math.nan]))
        rosout.wait_for(["/operator_node/signal: message refused: expected finite numbers, got nan"])
    assert len(windows.messages) == 5
    times_s, signals = reconstruct_interface_log_msg(windows.messages[-1], 2)
    assert signals.tolist() == [[0, 1, 2, 3, 4], [0, -1, -2, -3, -4]]
    assert before_s <= times_s[0] <= times_s[-1] <= after_s and times_s.tolist() == sorted(times_s)
    assert [dim.size for dim in windows.messages[-1].layout.dim] == [5, 3]


def test_window_at_a_rate_gets_empty_by_itself(ros):
    rospy.set_param("/operator_interface_logger", {"window_duration": 0.5, "hz": 50})
    ros.start(["rosrun", "operator_node", "operator_interface_logger"])
    windows = ros.listen("operator_node/window", Float64MultiArray)
    with publishing("operator_node/signal", Float64MultiArray) as signal:
        wait_until(lambda: windows.is_connected, "the window is heard")

        def is_repeated() -> bool:
            """Sends a signal, and returns whether the window with it came again; the node may stand still so long."""
            before = len(windows.messages)
            signal.publish(Float64MultiArray(data=[7.0]))
            wait_until(lambda: windows.messages[before:] and not windows.messages[-1].data, "the window is empty")
            sizes = [len(message.data) for message in windows.messages[before:]]
            assert sizes == sorted(sizes, reverse=True) and sizes.count(0) == 1
            return sizes.count(2) > 1

        wait_until(is_repeated, "a window is repeated")
