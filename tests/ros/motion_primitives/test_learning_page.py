"""The code blocks of docs/learning.md run one after the other."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import rosbag
import rospy
import yaml
from geometry_msgs.msg import Transform, TransformStamped, Vector3
from shown_motions import reach
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from motion_primitives.node_configs import PrimitivesNodeConfig

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs/learning.md").read_text()


def write_recording(path: Path) -> None:
    shown = reach(samples=201)
    with rosbag.Bag(str(path), "w") as bag:
        for time_s, point in zip(shown.times, shown.points):
            transform = TransformStamped(
                Header(0, rospy.Time.from_sec(time_s + 1.0), "rpbi/world"), "hand", Transform()
            )
            transform.transform.translation = Vector3(*point[:3])
            transform.transform.rotation.w = 1.0
            bag.write("/tf", TFMessage([transform]), transform.header.stamp)


def test_the_blocks_run_one_after_the_other(tmp_path):
    blocks = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert len(blocks) == 6
    write_recording(tmp_path / "recording.bag")
    program = [str(ROOT / ".venv/bin/python"), "-c", "\n".join(blocks)]
    done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    (shown,) = re.findall(r"```text\n(3.0 s to .*?)\n```", PAGE)
    lines = done.stdout.splitlines()
    assert lines[:3] == [shown, "201 samples in 10.00 s", "half-way at [0.25 0.1  0.45]"]
    assert lines[3].startswith("spread of the demonstrations at the end: [0.0")
    assert lines[4:6] == ["period 2.000 s", "x from 0.450 to 0.550 m"]
    assert lines[6].endswith(" s at [0.4 0.3 0.3]") and lines[7] == "True"


def test_the_configuration_is_valid():
    (block,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    PrimitivesNodeConfig.parse(yaml.safe_load(block), "docs/learning.md")
    commented = re.sub(r"^  # ", "  ", block, flags=re.MULTILINE)
    assert yaml.safe_load(commented)["source"].keys() == {"tf", "joints"}


def test_the_page_has_the_services_and_topics_of_the_node():
    node = (ROOT / "src/motion_primitives/src/motion_primitives/ros/primitives_node.py").read_text()
    named = set(re.findall(r'"primitive/(\w+)"', node))
    lists = re.findall(r"for name, act(?:ion)? in \((.*)\):", node)
    named |= {name for text in lists for name in re.findall(r'\("(\w+)"', text)}
    page = set(re.findall(r"`primitive/(\w+)`", PAGE))
    assert named - {"signal"} == page - {"signal"} and len(named) > 10
