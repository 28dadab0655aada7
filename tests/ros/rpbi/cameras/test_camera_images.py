"""Images of a camera as other nodes see them, of one world that tests leave as it was."""

from __future__ import annotations

import io
import math
import os
import re
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from camera_world import COLOUR, DEPTH, HEIGHT_M, SEGMENTATION, arm_world, pixels, place, renderers
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from PIL import Image as Picture
from ros_system import wait_until
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState

ROOT = Path(__file__).resolve().parents[4]
COLOUR_INFO, DEPTH_INFO = "/rpbi/camera/colour/camera_info", "/rpbi/camera/depth/camera_info"


@pytest.fixture(scope="module")
def node(module_ros):
    with place("rpbi/eye"):
        yield module_ros.simulator(arm_world(module_ros), use_sim_time=True)


def test_images_of_a_frame_share_stamp_frame_and_intrinsics(ros, node):
    listeners = {
        topic: ros.listen(topic, Image if "info" not in topic else CameraInfo)
        for topic in (COLOUR, DEPTH, SEGMENTATION, COLOUR_INFO, DEPTH_INFO)
    }

    def shared_stamps():
        return set.intersection(*(set(listener.stamps_ns) for listener in listeners.values()))

    wait_until(lambda: len(shared_stamps()) >= 10, "ten frames have come")
    shared = shared_stamps()
    assert {message.header.frame_id for each in listeners.values() for message in each.messages} == {"rpbi/eye"}
    assert all(stamp % 10_000_000 == 0 for stamp in shared)  # stamps of ticks
    colour, depth, segmentation = (listeners[topic].messages[-1] for topic in (COLOUR, DEPTH, SEGMENTATION))
    assert [image.encoding for image in (colour, depth, segmentation)] == ["rgb8", "32FC1", "mono16"]
    assert {(image.width, image.height) for image in (colour, depth, segmentation)} == {(160, 120)}
    assert [image.step for image in (colour, depth, segmentation)] == [480, 640, 320]
    info = listeners[COLOUR_INFO].messages[-1]
    focal_px = 60.0 / math.tan(math.radians(25.0))
    assert info.K == pytest.approx([focal_px, 0, 79.5, 0, focal_px, 59.5, 0, 0, 1])
    assert info.P == pytest.approx([focal_px, 0, 79.5, 0, 0, focal_px, 59.5, 0, 0, 0, 1, 0])
    assert info.R == pytest.approx(np.eye(3).ravel())
    assert (info.distortion_model, info.D) == ("plumb_bob", (0.0,) * 5)
    floor_m = pixels(depth, np.float32)[2:10, 2:10]
    assert floor_m == pytest.approx(HEIGHT_M - 0.005, abs=1e-3)


def test_jpegs_equal_colour_images_of_their_stamps_in_fewer_bytes(ros, node):
    colour, jpeg = ros.listen(COLOUR, Image), ros.listen(f"{COLOUR}/compressed", CompressedImage)
    wait_until(lambda: len(set(colour.stamps_ns) & set(jpeg.stamps_ns)) >= 5, "five images have come as both")
    raw = {image.header.stamp: pixels(image, np.uint8, 3) for image in list(colour.messages)}
    for image in [image for image in list(jpeg.messages) if image.header.stamp in raw]:
        assert (image.header.frame_id, image.format) == ("rpbi/eye", "rgb8; jpeg compressed bgr8")
        decoded = np.asarray(Picture.open(io.BytesIO(image.data)).convert("RGB"), float)
        assert np.abs(decoded - raw[image.header.stamp]).mean() < 3.0
        assert len(image.data) < raw[image.header.stamp].size / 5


def test_the_viewer_of_the_page_on_networks_shows_them(ros, node):
    (block,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/network.md").read_text(), re.DOTALL)
    viewer = ros.start([sys.executable, "-c", block])
    assert viewer.wait(60.0) == 0, ros.output(viewer)
    assert re.search(r"\(120, 160, 3\) \d+ bytes", ros.output(viewer))


def test_stopped_renderer_is_a_warning_of_the_diagnostics(ros, node):
    diagnostics = ros.listen("/diagnostics", DiagnosticArray)
    wait_until(lambda: diagnostics.messages and renderers(node), "there are diagnostics")
    (stopped,) = renderers(node)
    os.kill(stopped, signal.SIGSTOP)
    try:
        fault = f"the renderer (process {stopped}) is stopped by a signal"
        wait_until(lambda: fault in diagnostics.messages[-1].status[0].message, "the diagnostics warn")
        assert diagnostics.messages[-1].status[0].level == DiagnosticStatus.WARN
    finally:
        os.kill(stopped, signal.SIGCONT)
    wait_until(lambda: fault not in diagnostics.messages[-1].status[0].message, "it answers again")


def test_killed_renderer_comes_back_and_no_joint_state_is_missing(ros, node):
    colour = ros.listen(COLOUR, Image)
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    colour.wait_for(3)
    (killed,) = renderers(node)
    os.kill(killed, signal.SIGKILL)
    wait_until(lambda: renderers(node) not in ([], [killed]), "there is another renderer")
    before = len(colour.messages)
    colour.wait_for(before + 5)
    assert ros.output(node).count("ended with signal SIGKILL") == 1
    steps_ns = set(np.diff(joint_states.stamps_ns))
    assert steps_ns == {20_000_000}
