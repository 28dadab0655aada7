"""What docs/data.md tells people to type works."""

from __future__ import annotations

import re
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import genpy
import numpy as np
import pytest
import rosbag
import written_episodes
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TransformStamped
from matplotlib import font_manager  # noqa: F401 (it writes a cache, which a limit of files would cut off)
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Float64, Header
from tf2_msgs.msg import TFMessage

from custom_ros_tools.console.modules import command_of
from ros_pybullet_interface.msg import ContactPoint, Contacts
from rpbi_data import EpisodeFolder

ROOT = Path(__file__).resolve().parents[4]
PAGE = (ROOT / "docs/data.md").read_text()


@pytest.fixture
def recording(write_bag: Callable[..., Path]) -> Path:
    """A bag like the demo's, with the robot at 0.1 * t and targets 0.01 ahead."""
    messages: list[tuple[str, Any]] = []
    for index in range(100):
        header = Header(stamp=genpy.Time.from_sec(1 + index / 100), frame_id="rpbi/world")
        angle = index / 1000
        target = JointState(header, ["lwr_arm_0_joint"], [angle + 0.01], [], [])
        state = JointState(header, ["lwr_arm_0_joint", "lwr_arm_1_joint"], [angle, 0.0], [0.1, 0.0], [1.0, 2.0])
        box = TransformStamped(header=header, child_frame_id="rpbi/box")
        box.transform.rotation.w = 1.0
        loop = DiagnosticStatus(name="loop", values=[KeyValue("overruns", str(index))])
        pixels = np.full((2, 3), 1.5, np.float32)
        image = Image(header=header, height=2, width=3, encoding="32FC1", step=12, data=pixels.tobytes())
        colour = Image(header=header, height=2, width=3, encoding="rgb8", step=9, data=bytes(18))
        arm = ContactPoint(link="link0", other_body="kuka_lwr", normal_force=index / 10)
        floor = ContactPoint(link="link0", other_body="floor", normal_force=8.0)
        contacts = Contacts(header=header, points=[floor, arm] if index % 2 else [floor])
        messages += [
            ("/rpbi/kuka_lwr/joint_states/target", target),
            ("/rpbi/kuka_lwr/joint_states", state),
            ("/tf", TFMessage([box])),
            ("/rpbi/box/contacts", contacts),
            ("/diagnostics", DiagnosticArray(header, [loop])),
            ("/rpbi/camera/depth/image", image),
            ("/rpbi/camera/colour/image", colour),
        ]
    return write_bag(messages, name="recording.bag", compression="lz4")


def test_the_examples_run_one_after_the_other(
    ros: Any, recording: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(recording.parent)
    monkeypatch.setattr(written_episodes, "STATES", "/rpbi/kuka_lwr/joint_states")
    for seconds in (0.2, 0.4):
        written_episodes.write_episode(EpisodeFolder(Path("demos")), seconds=seconds, cameras=())
    blocks = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    assert len(blocks) == 12
    names: dict[str, Any] = {}
    for block in blocks:
        exec(compile(block, "docs/data.md", "exec"), names)
    assert names["error"].abs().max() == pytest.approx(0.01)
    assert names["speed"]["position/lwr_arm_0_joint"].mean() == pytest.approx(0.1)
    assert (recording.parent / "positions.png").stat().st_size > 1000
    assert len(names["path"]) == 100
    assert names["values"]["values/overruns"].max() == 99
    together, errors = names["together"]
    assert len(together) == 50
    assert (together["target/position/lwr_arm_0_joint"] - together["arm/position/lwr_arm_0_joint"]).max() < 0.0101
    assert errors.max() < 0.0051
    assert len(names["box"]) == 100
    assert len(list((recording.parent / "depth").iterdir())) == 101
    assert (recording.parent / "camera.mp4").stat().st_size > 1000
    assert names["pixels"].shape == (2, 3, 3)
    assert len(names["farthest"]) == 100 and {depth for _, depth in names["farthest"]} == {1.5}
    printed = capsys.readouterr().out
    assert "episode\n0    20\n1    40\n" in printed
    assert "largest error: 0.0100 rad" in printed
    assert "pushed with up to 9.9 N, for 50% of the time" in printed


def test_the_command_has_the_options_of_the_page(recording: Path) -> None:
    command = [sys.executable, str(ROOT / "devel/lib/rpbi_utils/bag_to_table")]
    text = subprocess.run([*command, "--help"], capture_output=True, text=True).stdout
    documented = set(re.findall(r"^\| `(--\w+)", PAGE, flags=re.MULTILINE))
    assert documented == set(re.findall(r"(--\w+)", text)) - {"--help"}


def test_plots_are_written_near_the_bag(recording: Path) -> None:
    ended = subprocess.run([str(ROOT / "rpbi"), "plot", str(recording)], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    written = [Path(line) for line in ended.stdout.splitlines()]
    assert {path.name for path in written} >= {"rpbi.kuka_lwr.joint_states.png", "rpbi.box.contacts.png", "rates.png"}
    assert all(path.parent == recording.with_name("recording_plots") for path in written)
    assert all(path.stat().st_size > 1000 for path in written)


def test_plot_names_mixed_message_types_and_leaves_no_partial_picture(
    write_bag: Callable[..., Path],
    file_limit: Callable[[int], None],
    caplog: pytest.LogCaptureFixture,
    capsys: pytest.CaptureFixture[str],
) -> None:
    bag = write_bag([("/a", JointState(name=["a"], position=[index])) for index in range(3)])
    with rosbag.Bag(str(bag), "a") as opened:
        opened.write("/a", Float64(), genpy.Time(101))
    command = command_of("rpbi_data.console.plot")
    assert command is not None
    file_limit(5_000)
    assert command.run([str(bag)]) == 1
    file_limit(resource.RLIM_INFINITY)
    assert "a figure cannot be written: [Errno 27] File too large" in capsys.readouterr().err
    assert list(bag.with_name("test_plots").iterdir()) == []
    came = "sensor_msgs/JointState (messages: 3), std_msgs/Float64 (messages: 1)"
    assert f"/a: expected messages of one type, got {came}" in caplog.text
