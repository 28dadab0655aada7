"""Synchronous cameras: every due tick has its image, and who steps gets it before the answer."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest
from camera_world import CAMERA, HEIGHT_M, box_world, renderers
from ros_system import wait_until
from sensor_msgs.msg import Image
from std_msgs.msg import Int64
from std_srvs.srv import Trigger

DEPTH = "/rpbi/camera/depth/image"
DT_NS = 10_000_000
SYNCHRONOUS = {**CAMERA, "synchronous": True}


def test_free_running_world_has_an_image_of_every_due_tick(ros, placed):
    depth = ros.listen(DEPTH, Image)
    ros.simulator(box_world(ros, rgbd_sensor=SYNCHRONOUS, real_time_factor=0), use_sim_time=True)
    depth.wait_for(60)
    ticks = [stamp // DT_NS - 1 for stamp in depth.stamps_ns]
    due = [tick for tick in range(1, max(ticks) + 1) if tick * 30 // 100 > (tick - 1) * 30 // 100]
    assert ticks == due  # from the first one on


def test_image_of_a_step_comes_before_its_answer(ros, placed):
    depth = ros.listen(DEPTH, Image)
    config = box_world(ros, rgbd_sensor=SYNCHRONOUS, start_pybullet_after_initialization=False)
    ros.simulator(config, use_sim_time=True)
    depth.wait_for(1)
    for _ in range(20):
        answer = ros.call("/rpbi/step", Trigger)
        assert answer.success, answer.message
        stamp_ns = int(answer.message.split("stamp ")[1].replace(".", ""))
        wait_until(lambda stamp_ns=stamp_ns: depth.stamps_ns[-1] == stamp_ns, "the image of the step is here")
    assert np.array_equal(np.diff(depth.stamps_ns), [DT_NS] * 20)
    image = np.frombuffer(depth.messages[-1].data, np.float32).reshape(120, 160)
    assert image[60, 80] == pytest.approx(HEIGHT_M - 0.2, abs=2e-3)


def test_world_does_not_wait_for_a_camera_without_viewers(ros, placed):
    config = box_world(ros, rgbd_sensor=SYNCHRONOUS, start_pybullet_after_initialization=False)
    ros.simulator(config, use_sim_time=True)
    for _ in range(5):
        assert ros.call("/rpbi/step", Trigger).success


def test_renderer_crash_stops_the_world_and_a_start_continues(ros, placed):
    depth = ros.listen(DEPTH, Image)
    status = ros.listen("/rpbi/status", Int64)
    simulator = ros.simulator(box_world(ros, rgbd_sensor={**SYNCHRONOUS, "hz": 100}), use_sim_time=True)
    depth.wait_for(5)
    (renderer,) = renderers(simulator)
    os.kill(renderer, signal.SIGSTOP)
    count = len(status.messages)
    os.kill(renderer, signal.SIGKILL)
    wait_until(lambda: "simulation stopped: camera 'eye' is synchronous" in ros.output(simulator), "it says so")
    wait_until(lambda: status.messages[-1].data == 0 and len(status.messages) > count, "it stands still")
    assert ros.call("/rpbi/start", Trigger).success
    count = len(depth.messages)
    depth.wait_for(count + 5)
    after = depth.stamps_ns[count:]
    assert set(np.diff(after)) == {DT_NS}


@pytest.mark.thorough
def test_world_stops_and_names_the_missing_frame_of_its_camera(ros):
    ros.listen(DEPTH, Image)
    simulator = ros.simulator(box_world(ros, rgbd_sensor=SYNCHRONOUS), use_sim_time=True)
    complaint = "simulation stopped: camera 'eye' is synchronous: there is no TF to 'rpbi/eye' after 20 s"
    wait_until(lambda: complaint in ros.output(simulator), "it says so")
