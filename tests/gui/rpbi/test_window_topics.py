"""What PyBullet's window has in ROS: its keys, mouse, camera and images, with real key presses and mouse moves."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from node_world import publishing
from pybullet_window import SLOW_S, floating_ball, middle, mostly, open_window, window
from ros_system import wait_until
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import Image
from std_msgs.msg import Int64MultiArray

from ros_pybullet_interface.msg import KeyboardEvent, MouseEvent, ResetDebugVisualizerCamera
from ros_pybullet_interface.srv import GetDebugVisualizerCamera

IMAGE_WIDTH, IMAGE_HEIGHT = 80, 60
TARGET = [0.5, 0.0, 1.0]
PRESSED, HELD, RELEASED = 3, 1, 4
WORDS = {PRESSED: "", HELD: "key_is_down", RELEASED: "key_was_released"}
LEFT_ARROW = 65295
"""PyBullet's code."""
CAMERA = {"cameraDistance": 2.0, "cameraYaw": 30.0, "cameraPitch": -20.0, "cameraTargetPosition": TARGET}


@pytest.fixture(scope="module")
def place(module_ros, screen):
    """Where the window of a simulator with all that windows have is; the mouse is in the middle of it."""
    red = floating_ball(module_ros, "red", [1.0, 0.0, 0.0, 1.0], TARGET, radius_m=0.4)
    open_window(
        module_ros,
        screen,
        enable_keyboard_publisher=True,
        enable_mouse_publisher=True,
        publish_visualizer_image_hz=20,
        visualizer_image_width=IMAGE_WIDTH,
        visualizer_image_height=IMAGE_HEIGHT,
        resetDebugVisualizerCamera=CAMERA,
        visual_objects=[red],
    )
    found = window(screen)
    move(screen, found, 200, 150)
    return found


@pytest.fixture(scope="module")
def all_keys(module_ros, place):
    """Key events of all tests: publishers keep a connection that is closed until they next write to it."""
    listener = module_ros.listen("/rpbi/keyboard", KeyboardEvent)
    wait_until(lambda: listener.is_connected, "the keyboard is heard")
    return listener


@pytest.fixture
def keys(all_keys):
    """Key events of one test."""
    all_keys.messages.clear()
    return all_keys


@pytest.fixture
def mouse(ros, place):
    """Mouse events."""
    listener = ros.listen("/rpbi/mouse", MouseEvent)
    wait_until(lambda: listener.is_connected, "the mouse is heard")
    return listener


def move(screen, place, column, row):
    """Moves the mouse to a pixel of the window."""
    screen.run("xdotool", "mousemove", str(place.x + column), str(place.y + row))


def happened(listener):
    """Returns what happened to keys, but for those that are held: code and state each."""
    return [(each.key, each.state) for each in list(listener.messages) if each.state != HELD]


def camera_orders():
    """Returns the context of a publisher that tells the window's camera where to go."""
    return publishing("/rpbi/reset_debug_visualizer_camera", ResetDebugVisualizerCamera)


def present_camera(ros):
    """Returns the window's camera as numbers: distance, yaw, pitch, target."""
    camera = ros.call("/rpbi/get_debug_visualizer_camera", GetDebugVisualizerCamera).debug_visualizer_config
    return (camera.cameraDistance, camera.cameraYaw, camera.cameraPitch, *camera.cameraTargetPosition)


def test_held_key_is_pressed_once_held_and_released_once(screen, keys):
    screen.run("xdotool", "keydown", "a")
    time.sleep(1.5)  # long enough for a keyboard that repeats keys
    wait_until(lambda: len(keys.messages) > 5, "it is held", SLOW_S)
    screen.run("xdotool", "keyup", "a")
    wait_until(lambda: happened(keys)[-1:] == [(97, RELEASED)], "the key is released", SLOW_S)
    assert happened(keys) == [(97, PRESSED), (97, RELEASED)]
    states = [each.state for each in keys.messages]
    assert states == [PRESSED, *[HELD] * (len(states) - 2), RELEASED]
    assert {(each.state, each.state_str) for each in keys.messages} == set(WORDS.items())
    assert all(each.header.stamp.to_nsec() > 0 for each in keys.messages)


def test_taps_are_neither_lost_nor_doubled(screen, keys):
    letters = "qwertyuiop"
    for letter in letters:
        screen.run("xdotool", "key", letter)
    wait_until(lambda: len(happened(keys)) >= 2 * len(letters), "all taps have come", SLOW_S)
    time.sleep(0.3)
    assert sorted(happened(keys)) == sorted((ord(each), state) for each in letters for state in (PRESSED, RELEASED))
    for letter in letters:
        assert [state for key, state in happened(keys) if key == ord(letter)] == [PRESSED, RELEASED]


def test_special_keys_have_pybullet_codes_and_unknown_keys_are_omitted(screen, keys):
    screen.run("xdotool", "key", "Tab")
    screen.run("xdotool", "key", "Left")
    wait_until(lambda: (LEFT_ARROW, RELEASED) in happened(keys), "the arrow key has come", SLOW_S)
    assert happened(keys) == [(LEFT_ARROW, PRESSED), (LEFT_ARROW, RELEASED)]


def test_mouse_topic_reports_positions_and_buttons(screen, place, mouse):
    move(screen, place, 100, 70)
    mouse.wait_for(1, SLOW_S)
    for count, button in ((2, "mousedown"), (3, "mouseup")):
        screen.run("xdotool", button, "1")
        mouse.wait_for(count, SLOW_S)
    move(screen, place, 120, 90)
    wait_until(lambda: mouse.messages[-1].mouse_pos_x == 120.0, "it has moved on", SLOW_S)
    told = [
        (each.event_type, each.event_type_str, each.mouse_pos_x, each.mouse_pos_y, each.button_index, each.button_state)
        for each in mouse.messages
    ]
    assert told == [
        (1, "mouse_move_event", 100.0, 70.0, 255, 0),
        (2, "mouse_button_event", 100.0, 70.0, 0, PRESSED),
        (2, "mouse_button_event", 100.0, 70.0, 0, RELEASED),
        (1, "mouse_move_event", 120.0, 90.0, 255, 0),
    ]
    assert [each.button_state_str for each in mouse.messages] == [each.button_state for each in mouse.messages]


def test_camera_goes_where_it_is_sent_and_reports_mouse_turns(ros, screen, place):
    told = ros.listen("/rpbi/debug_visualizer_camera", ResetDebugVisualizerCamera)
    told.wait_for(1, SLOW_S)
    wanted = (2.5, 50.0, -30.0, 0.25, 0.0, 0.5)
    with camera_orders() as publisher:
        publisher.publish(ResetDebugVisualizerCamera(*wanted[:3], wanted[3:]))
        wait_until(lambda: present_camera(ros) == pytest.approx(wanted), "it looks from there", SLOW_S)

    move(screen, place, 240, 180)
    screen.run("xdotool", "keydown", "ctrl", "mousedown", "1")
    time.sleep(0.3)
    move(screen, place, 300, 180)
    time.sleep(0.3)
    screen.run("xdotool", "mouseup", "1", "keyup", "ctrl")
    wait_until(lambda: abs(present_camera(ros)[1] - wanted[1]) > 5.0, "the mouse has turned it", SLOW_S)

    def is_told():
        last = told.messages[-1]
        topic = (last.cameraDistance, last.cameraYaw, last.cameraPitch, *last.cameraTargetPosition)
        return topic == pytest.approx(present_camera(ros))

    wait_until(is_told, "the topic tells of it", SLOW_S)


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ((math.nan, 0.0, 0.0, [0.0] * 3), "cameraDistance"),
        ((0.0, 0.0, 0.0, [0.0] * 3), "cameraDistance"),
        ((1.0, math.inf, 0.0, [0.0] * 3), "cameraYaw"),
        ((1.0, 0.0, 0.0, [0.0, 0.0]), "cameraTargetPosition"),
    ],
)
def test_camera_that_makes_no_sense_is_refused_and_named(ros, place, values, complaint):
    before = present_camera(ros)
    logs = ros.listen("/rosout", Log)
    wait_until(lambda: logs.is_connected, "the log is heard")
    with camera_orders() as publisher:

        def is_told():
            publisher.publish(ResetDebugVisualizerCamera(*values))
            time.sleep(0.2)
            return any(f"message refused: {complaint}" in log.msg for log in logs.messages)

        wait_until(is_told, f"{complaint} is refused")
    assert present_camera(ros) == before


def test_images_show_the_content_of_the_window(ros, screen, place):
    with camera_orders() as publisher:
        publisher.publish(ResetDebugVisualizerCamera(*CAMERA.values()))
        wait_until(lambda: present_camera(ros)[0] == pytest.approx(2.0), "it looks from there", SLOW_S)
    images = ros.listen("/rpbi/visualizer_image", Image)
    numbers = ros.listen("/rpbi/visualizer_image_int", Int64MultiArray)
    numbers.wait_for(2, SLOW_S)
    image = images.wait_for(3, SLOW_S)[-1]
    assert (image.width, image.height, image.step) == (IMAGE_WIDTH, IMAGE_HEIGHT, 3 * IMAGE_WIDTH)
    assert (image.encoding, image.header.frame_id) == ("rgb8", "")
    assert all(np.diff(images.stamps_ns) > 0)
    picture = np.frombuffer(image.data, np.uint8).reshape(IMAGE_HEIGHT, IMAGE_WIDTH, 3)
    red = mostly(picture, 0)
    assert middle(red) == pytest.approx((IMAGE_WIDTH / 2 - 0.5, IMAGE_HEIGHT / 2 - 0.5), abs=1.0)
    radius_px = IMAGE_HEIGHT / 2 * 0.4 / math.sqrt(2.0**2 - 0.4**2)  # it opens 90 deg vertically
    assert red.sum() == pytest.approx(math.pi * radius_px**2, rel=0.15)
    rgba = np.reshape(numbers.messages[-1].data, (IMAGE_HEIGHT, IMAGE_WIDTH, 4))
    assert (rgba[..., :3] == picture).mean() > 0.99
    assert numbers.messages[-1].layout.dim == []
