"""What belongs to PyBullet's window, in a world without one: it loads, and says that there is none."""

from __future__ import annotations

import pytest
import rosgraph
from node_world import Rosout, main_config, publishing

from ros_pybullet_interface.msg import ResetDebugVisualizerCamera
from ros_pybullet_interface.srv import GetDebugVisualizerCamera

KEYS = {
    "resetDebugVisualizerCamera": {"cameraDistance": 2.5, "cameraYaw": 30.0, "cameraPitch": -20.0}
    | {"cameraTargetPosition": [0.0, 0.0, 0.5]},
    "enable_keyboard_publisher": True,
    "enable_mouse_publisher": True,
    "publish_visualizer_image_hz": 10,
    "visualizer_image_width": 320,
    "visualizer_image_height": 240,
}
CONNECT = {"connection_mode": "DIRECT", "options": "--mp4=never.mp4"}


@pytest.fixture
def node(ros, tmp_path):
    return ros.simulator(main_config(tmp_path, connect=CONNECT, **KEYS))


@pytest.mark.quick
def test_window_keys_give_one_warning_and_open_no_topic(ros, node):
    output = ros.output(node)
    keys = "enable_keyboard_publisher, enable_mouse_publisher, publish_visualizer_image_hz, connect.options --mp4="
    assert output.count(f"{keys}: no effect without a window") == 1
    published, _, _ = rosgraph.Master("/tests").getSystemState()
    names = {topic for topic, _ in published}
    assert not names & {
        f"/rpbi/{name}" for name in ("keyboard", "mouse", "visualizer_image", "debug_visualizer_camera")
    }


def test_window_camera_has_its_configured_pose_and_refuses_changes(ros, node):
    camera = ros.call("/rpbi/get_debug_visualizer_camera", GetDebugVisualizerCamera).debug_visualizer_config
    assert camera == ResetDebugVisualizerCamera(2.5, 30.0, -20.0, (0.0, 0.0, 0.5))
    rosout = Rosout(ros)
    with publishing("/rpbi/reset_debug_visualizer_camera", ResetDebugVisualizerCamera) as publisher:
        publisher.publish(ResetDebugVisualizerCamera(1.0, 0.0, 0.0, [0.0, 0.0, 0.0]))
        rosout.wait_for(["/rpbi/reset_debug_visualizer_camera: message refused: there is no window"])
