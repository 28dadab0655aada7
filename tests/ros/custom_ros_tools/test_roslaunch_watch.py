"""Nodes whose roslaunch is killed end, with their renderer; those that nobody launched stay."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from node_world import main_config
from ros_system import is_running, wait_until
from worlds import FLOOR

LAUNCH = """<launch>
  <node pkg="ros_pybullet_interface" type="ros_pybullet_interface_node.py" name="launched" output="screen">
    <rosparam command="load" param="config" file="{world}"/>
  </node>
  <node pkg="custom_ros_tools" type="resettable_static_transform_publisher" name="stands" output="screen"
        args="0 0 0 0 0 0 1 map other"/>
</launch>
"""


def descendants(parent: int) -> set[int]:
    """Returns the ids of a process's children, of theirs, and so on."""
    parents = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(path.parent.name)] = int(path.read_text().rpartition(")")[2].split()[1])
        except OSError:  # it has just ended
            continue
    found = {parent}
    while new := {each for each, its in parents.items() if its in found} - found:
        found |= new
    return found - {parent}


def test_nodes_end_after_their_roslaunch_is_killed(ros, tmp_path):
    camera = {"name": "eye", "hz": 5, "intrinsics": {"width": 32, "height": 24, "fov": 60, "range": [0.1, 5.0]},
              "object_tf": {"tf_id": "eye", "hz": 10}}  # fmt: skip
    world = ros.write_yaml("main.yaml", {**main_config(tmp_path, collision=(FLOOR,)), "rgbd_sensor": camera})
    (tmp_path / "all.launch").write_text(LAUNCH.format(world=world))
    roslaunch = ros.start(["roslaunch", str(tmp_path / "all.launch")], fresh=True)
    wait_until(lambda: "images are drawn by" in ros.output(roslaunch), "the renderer is up")
    nodes = descendants(roslaunch.pid)
    assert len(nodes) >= 3, "the simulator, its renderer, and a frame"
    os.kill(roslaunch.pid, signal.SIGKILL)
    wait_until(lambda: not any(map(is_running, nodes)), "all have ended", timeout_s=30.0)
    assert "Traceback" not in ros.output(roslaunch)


@pytest.mark.parametrize(("argument", "ends"), [("__log:=/dev/null", True), ("__name:=mine", False)])
def test_only_nodes_of_roslaunch_watch_their_parent(tmp_path, argument, ends):
    """Others outlive theirs, such as a node in the background of a shell that is closed."""
    program = (
        "import signal, threading\n"
        "signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})\n"
        "from custom_ros_tools.program import end_with_roslaunch\n"
        "end_with_roslaunch()\n"
        "print(threading.active_count(), flush=True)\n"
        "signal.sigtimedwait({signal.SIGINT}, 60.0 if threading.active_count() > 1 else 0.0)\n"
        "print('over')\n"
    )
    said = tmp_path / "said"
    shell = f"{shlex.join([sys.executable, '-c', program, argument])} >{said} 2>&1 & "
    subprocess.run(["bash", "-c", shell + f"until [[ -s {said} ]]; do sleep 0.1; done; kill -KILL $$"], timeout=120.0)
    wait_until(lambda: "over" in said.read_text(), "it has ended")
    assert said.read_text().startswith("2" if ends else "1")
    assert ("roslaunch has ended" in said.read_text()) == ends
