"""PyBullet's own window: what it shows, and how a node with a window lives and ends."""

from __future__ import annotations

import math
import os
import shutil
import signal
import time
from pathlib import Path

import numpy as np
import pybullet
import pybullet_data
import pytest
import rosgraph
from diagnostic_msgs.msg import DiagnosticArray
from pybullet_window import HEIGHT, SLOW_S, WIDTH, floating_ball, middle, mostly, window
from ros_system import wait_until
from sensor_msgs.msg import Image, JointState
from worlds import FLOOR, iiwa

FIELD_OF_VIEW = math.radians(90.0)
"""Vertical opening of the window's camera."""
BACKGROUND = [0.1, 0.3, 0.1]
CAMERA = {
    "cameraDistance": 2.0,
    "cameraYaw": 40.0,
    "cameraPitch": -25.0,
    "cameraTargetPosition": [3.0, -1.0, 2.0],
}


@pytest.mark.quick
def test_window_has_its_configured_view_and_content(ros, screen, start):
    target = np.array(CAMERA["cameraTargetPosition"])
    aside = target + [0.5, 0.2, 0.3]
    start(
        resetDebugVisualizerCamera=CAMERA,
        configureDebugVisualizer={"flag": "COV_ENABLE_GUI|COV_ENABLE_SHADOWS", "rgbBackground": BACKGROUND},
        visual_objects=[
            floating_ball(ros, "red", [1.0, 0.0, 0.0, 1.0], target.tolist()),
            floating_ball(ros, "blue", [0.0, 0.0, 1.0, 1.0], aside.tolist()),
        ],
    )

    pictures = []

    def is_shown():
        time.sleep(0.1)
        pictures.append(screen.grab(window(screen)))
        pictures[:] = [each for each in pictures if not (each != pictures[-1]).any()]
        return len(pictures) > 5 and mostly(pictures[-1], 2).any()

    wait_until(is_shown, "the balls are shown, and it settles", SLOW_S)
    picture = pictures[-1]
    distance_m, yaw, pitch = (CAMERA[f"camera{key}"] for key in ("Distance", "Yaw", "Pitch"))
    view = pybullet.computeViewMatrixFromYawPitchRoll(target.tolist(), distance_m, yaw, pitch, 0.0, 2)
    focal_px = HEIGHT / 2 / math.tan(FIELD_OF_VIEW / 2)
    x, y, z, _ = np.array([*aside, 1.0]) @ np.reshape(view, (4, 4))
    assert middle(mostly(picture, 0)) == pytest.approx((WIDTH / 2, HEIGHT / 2), abs=3.0)
    assert middle(mostly(picture, 2)) == pytest.approx(
        (WIDTH / 2 - focal_px * x / z, HEIGHT / 2 + focal_px * y / z), abs=3.0
    )
    radius_px = focal_px * 0.15 / math.sqrt(distance_m**2 - 0.15**2)
    assert mostly(picture, 0).sum() == pytest.approx(math.pi * radius_px**2, rel=0.1)
    edges = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]])
    assert np.abs(edges - 255 * np.array(BACKGROUND)).max() < 3  # no panels there


@pytest.mark.thorough
def test_node_with_a_window_publishes_and_ends_on_interrupt(ros, screen, start):
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    images = ros.listen("/rpbi/camera/colour/image", Image)
    place = ["0", "0", "3", "0", "0", "3.1416", "rpbi/world", "rpbi/eye"]
    ros.start(["rosrun", "tf2_ros", "static_transform_publisher", *place])
    node = start(
        setAdditionalSearchPath="pybullet_data_path",
        collision_objects=[ros.write_yaml("floor.yaml", FLOOR)],
        robots=[ros.write_yaml("iiwa.yaml", iiwa())],
        rgbd_sensor={
            "name": "eye",
            "hz": 10,
            "intrinsics": {"width": 160, "height": 120},
            "object_tf": {"tf_id": "rpbi/eye"},
        },
    )
    joint_states.wait_for(100, SLOW_S)
    images.wait_for(5, SLOW_S)
    assert set(np.diff(joint_states.stamps_ns)) == {20_000_000}
    os.killpg(node.pid, signal.SIGINT)
    assert node.wait(SLOW_S) == 0
    assert "Traceback" not in ros.output(node)
    wait_until(lambda: window(screen) is None, "the window has gone", SLOW_S)


TWO_COLOURS = """<robot name="two"><link name="body">
<visual><geometry><mesh filename="block.obj"/></geometry>
<material name="red"><color rgba="1 0 0 1"/></material></visual>
<visual><origin xyz="0 0 0.3"/><geometry><box size="0.2 0.2 0.2"/></geometry>
<material name="blue"><color rgba="0 0 1 1"/></material></visual></link></robot>"""


@pytest.mark.thorough
def test_a_link_has_the_colour_of_its_first_visual(ros, screen, start, tmp_path):
    shutil.copy(Path(pybullet_data.getDataPath()) / "cube.obj", tmp_path / "block.obj")
    (tmp_path / "two.urdf").write_text(TWO_COLOURS)
    load = {"fileName": str(tmp_path / "two.urdf"), "useFixedBase": True}
    camera = {"cameraDistance": 4.0, "cameraTargetPosition": [0.0, 0.0, 0.0]}
    start(resetDebugVisualizerCamera=camera, urdfs=[ros.write_yaml("two.yaml", {"name": "two", "loadURDF": load})])

    def is_red():
        picture = screen.grab(window(screen))
        return mostly(picture, 0).sum() > 1000 and not mostly(picture, 2).any()

    wait_until(is_red, "it is red, with its mesh", SLOW_S)


@pytest.mark.thorough
def test_a_world_that_its_window_slows_down_says_so_once(ros, start):
    node = start(
        timeStep=0.001, setAdditionalSearchPath="pybullet_data_path", robots=[ros.write_yaml("arm.yaml", iiwa())]
    )
    told = "with its window, PyBullet takes"
    wait_until(lambda: told in ros.output(node), "it says what is slow", SLOW_S)
    ros.listen("/diagnostics", DiagnosticArray).wait_for(3, SLOW_S)
    assert ros.output(node).count(told) == 1


@pytest.mark.parametrize(
    "running",
    [pytest.param(True, id="running"), pytest.param(False, id="stopped", marks=pytest.mark.thorough)],
)
def test_closed_window_ends_the_node_with_one_line_and_code(ros, screen, start, running):
    node = start(
        setAdditionalSearchPath="pybullet_data_path",
        robots=[ros.write_yaml("iiwa.yaml", iiwa())],
        start_pybullet_after_initialization=running,
        enable_keyboard_publisher=running,  # which takes the other keys away from the window
    )
    place = window(screen)
    screen.run("xdotool", "mousemove", str(place.x + WIDTH // 2), str(place.y + HEIGHT // 2), "key", "Escape")
    assert node.wait(SLOW_S) == 1
    output = ros.output(node)
    assert output.count("window was closed") == 1
    assert "Traceback" not in output
    wait_until(lambda: not registered("/ros_pybullet_interface"), "the node has left the master")


def registered(node):
    """Returns whether the ROS master knows anything of a node."""
    return any(node in nodes for kind in rosgraph.Master("/tests").getSystemState() for _, nodes in kind)
