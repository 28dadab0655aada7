"""Two simulators on one master, by the launch file of docs/network.md."""

from __future__ import annotations

import re
from pathlib import Path

from node_world import objects
from ros_system import wait_until
from tf2_msgs.msg import TFMessage
from worlds import ball, write_world

PAGE = (Path(__file__).resolve().parents[4] / "docs/network.md").read_text()
[LAUNCH] = re.findall(r"^## Two simulators.*?^```xml\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)


def test_each_has_its_topics_and_frames(ros, tmp_path):
    world = write_world(tmp_path, dynamic=(ball(broadcast_hz=50),))
    launch = tmp_path / "two.launch"
    launch.write_text(f"<launch>{LAUNCH.replace('$(find my_package)/configs/world.yaml', world)}</launch>")
    ros.start(["roslaunch", "--wait", str(launch)])
    tf = ros.listen("/tf", TFMessage)
    for side in ("left", "right"):
        assert objects(ros, f"/{side}/") == {"ball": "dynamic"}

    def frames():
        return {each.child_frame_id for message in list(tf.messages) for each in message.transforms}

    wait_until(lambda: {"left/rpbi/ball", "right/rpbi/ball"} <= frames(), "both balls are on TF")
    assert all(frame.startswith(("left/", "right/")) for frame in frames())
