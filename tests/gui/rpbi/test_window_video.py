"""Videos of PyBullet's window."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
from pathlib import Path

import pytest
from pybullet_window import HEIGHT, SLOW_S, WIDTH, floating_ball, window
from ros_system import wait_until


def taken_by_ffmpeg(node: subprocess.Popen) -> int:
    """Returns how many bytes the program that makes a node's video has read."""
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it has just ended
            name, _, stat = (path / "stat").read_text().rpartition(")")
            if name.endswith("(ffmpeg") and int(stat.split()[2]) == node.pid:
                return int(re.search(r"^rchar: (\d+)$", (path / "io").read_text(), re.MULTILINE)[1])
    return 0


@pytest.mark.thorough
def test_window_is_recorded_and_the_video_plays(ros, screen, start):
    video = ros.folder / "window.mp4"
    node = start(
        options=f"--mp4={video}",
        visual_objects=[floating_ball(ros, "red", [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0])],
    )
    wait_until(lambda: taken_by_ffmpeg(node) > 10 * WIDTH * HEIGHT * 3, "there are pictures for it", SLOW_S)
    os.killpg(node.pid, signal.SIGINT)
    assert node.wait(SLOW_S) == 0
    wait_until(lambda: window(screen) is None, "the window has gone", SLOW_S)
    command = ["ffprobe", "-v", "error", "-count_frames", "-show_streams", "-of", "json", str(video)]
    (stream,) = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)["streams"]
    assert (stream["width"], stream["height"]) == (WIDTH, HEIGHT)
    assert int(stream["nb_read_frames"]) > 5


def test_recording_without_ffmpeg_ends_the_start_and_names_the_package(ros, screen, tmp_path):
    tools = tmp_path / "tools"  # all programs but ffmpeg
    tools.mkdir()
    for folder in map(Path, os.environ["PATH"].split(os.pathsep)):
        for program in folder.iterdir() if folder.is_dir() else ():
            if program.name != "ffmpeg" and not (tools / program.name).is_symlink():
                (tools / program.name).symlink_to(program)
    config = {"connect": {"connection_mode": "GUI", "options": f"--mp4={tmp_path / 'window.mp4'}"}}
    node = ros.simulator(config, wait=False, PATH=str(tools), **screen.environment)
    assert node.wait(SLOW_S) == 1
    assert "'ffmpeg' is not installed" in ros.output(node)
    assert "apt-get install ffmpeg" in ros.output(node)
    assert "Traceback" not in ros.output(node)
