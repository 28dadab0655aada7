"""A script with one thread is copied to predict and to fork; one with more has another program follow its world."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest
from ros_system import wait_until
from worlds import FLOOR, box, iiwa, write_world

SCRIPT = """
import os, sys, threading
import numpy as np
from rpbi.world import World

def height(world):
    return world.bodies["box"].base_pose().position[2]

def later(ticks):
    for _ in range(ticks):
        world.step()
    return world.state_hash()

world = World.from_file(sys.argv[1])
world.put("iiwa/target", {"lbr_iiwa_joint_2": 0.8})
later(50)
np.ones((500, 500)) @ np.ones((500, 500))  # starts OpenBLAS's threads
cost = height
if "threads" in sys.argv:
    threading.Thread(target=threading.Event().wait, daemon=True).start()
    cost = None  # another program does not know the script's functions
reading, writing = os.pipe()
(prediction,) = world.predict([[(3, "iiwa/target", {"lbr_iiwa_joint_4": 0.5})]], 30, cost=cost)
later(3)
world.put("iiwa/target", {"lbr_iiwa_joint_4": 0.5})
print("predicted", later(27) == prediction.state_hash, prediction.cost != 0.0)
later(100)
with world.fork()[0] as fork:
    fork.step(40)
    print("forked", later(40) == fork.state_hash())
print(type(world._shadow._process).__name__, len(os.listdir("/proc/self/task")))
os.close(writing)
print("end of a pipe", os.read(reading, 1))
print("follower", getattr(world._shadow._process, "_pid", 0), flush=True)
sys.stdin.read()
"""


@pytest.fixture
def start(tmp_path):
    """Starts the script, and returns its process and lines, up to the id of the process that follows its world."""
    world = write_world(tmp_path, collision=(FLOOR,), dynamic=(box("box"),), robots=(iiwa(),))
    started = []

    def run(*arguments: str) -> tuple[subprocess.Popen, list[str], int]:
        command = [sys.executable, "-c", SCRIPT, str(world), *arguments]
        process = subprocess.Popen(command, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        started.append(process)
        lines = []
        for line in process.stdout:
            if line.startswith("follower "):
                return process, lines, int(line.split()[1])
            lines.append(line.strip())
        raise AssertionError(f"it ended: {lines}")

    yield run
    for process in started:
        process.kill()
        process.communicate()


def test_copied_process_predicts_with_the_scripts_classes_and_closes_pipes(start):
    process, lines, _ = start()
    assert lines == ["predicted True True", "forked True", "_Copy 1", "end of a pipe b''"]
    process.communicate(timeout=20)
    assert process.returncode == 0


def test_with_another_thread_a_program_follows_the_world(start):
    _, lines, _ = start("threads")
    assert lines == ["predicted True False", "forked True", "Popen 2", "end of a pipe b''"]


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM])
def test_a_copy_ends_with_the_script(start, end):
    process, _, follower = start()
    os.kill(follower, 0)
    process.send_signal(end)
    process.wait()
    wait_until(lambda: not os.path.exists(f"/proc/{follower}"), "the end of the copy", 10.0)
