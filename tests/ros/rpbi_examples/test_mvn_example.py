"""`mvn.launch` shows the emulator's people on TF."""

from __future__ import annotations

import shlex
import subprocess

import numpy as np
import pytest
from geometry_msgs.msg import PoseArray
from tries import tries
from workplace import Port


def test_person_begins_in_a_t_pose_and_then_walks(ros):
    port = Port()
    poses = ros.listen("/mvn/segments", PoseArray)
    options = ["headless:=true", "people:=2", "speed:=0.6", f"port:={port.number}"]
    ros.start(["roslaunch", "rpbi_examples", "mvn.launch", *options])
    first = poses.wait_for(1)[0]
    assert first.header.frame_id == "rpbi/world" and len(first.poses) == 23

    def where(message):
        place = message.poses[0].position
        return np.array([place.x, place.y, place.z])

    came = len(poses.messages)
    for _ in tries("the person walks"):
        came += 60
        poses.wait_for(came)
        if np.linalg.norm(where(poses.messages[-1]) - where(first)) >= 0.2:
            break
    assert 0.7 < where(poses.messages[-1])[2] < 1.0


@pytest.mark.parametrize(
    ("loop", "more"), [("true", ["--loop"]), pytest.param("false", [], marks=pytest.mark.thorough)]
)
def test_a_recording_is_played(loop, more):
    command = ["roslaunch", "--args", "mvn_player", "rpbi_examples", "mvn.launch", "source:=player", "headless:=true"]
    done = subprocess.run([*command, f"loop:={loop}", "file:=/walks/a.mvn"], capture_output=True, text=True)
    words = shlex.split(done.stdout.strip().splitlines()[-1])
    assert words[1 : 4 + len(more)] == ["/walks/a.mvn", "--port", "9763", *more], done.stderr
