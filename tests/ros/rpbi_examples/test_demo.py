"""The main job end to end, as a user runs it."""

from __future__ import annotations

import contextlib
import json
import re
import signal
import subprocess
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image
from ros_system import wait_until

from custom_ros_tools.console.modules import command_of
from rpbi_data import bag_to_dataframes

ROOT = Path(__file__).resolve().parents[3]
JOINTS = [f"lwr_arm_{number}_joint" for number in range(7)]


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    out = tmp_path_factory.mktemp("demo")
    command = ["rosrun", "rpbi_examples", "demo.py", "--headless", "--seconds", "5", "--out", str(out)]
    return out, subprocess.run(command, capture_output=True, text=True, timeout=500)


def test_it_writes_all_that_it_promises(demo):
    out, run = demo
    names = {
        "recording.bag",
        "joint_states.parquet",
        "joints.png",
        "efforts.png",
        "forces.png",
        "colour.png",
        "depth.png",
        "summary.json",
    }
    assert names <= {path.name for path in out.iterdir()}, run.stderr


def test_slowness_is_reported_and_is_no_failure(demo):
    """How many images a busy machine draws is not for a test to say; that too few have their line is."""
    out, run = demo
    summary = json.loads((out / "summary.json").read_text())
    too_few = {topic for topic, row in summary["topics"].items() if not row["enough"]}
    too_slow = summary["figures"]["real_time_factor"] < 0.95
    assert run.returncode == 0 and "FAILED" not in run.stderr, run.stderr
    assert ("SLOW: physics ran at" in run.stderr) == too_slow
    images = {topic for topic in too_few if "/camera/" in topic}
    assert len(re.findall(r"^SLOW: images came at ", run.stderr, re.MULTILINE)) == bool(images)
    assert all(f"{topic} came at " in run.stderr for topic in too_few - images)
    assert len(summary["topics"]) == 10
    assert all(row["messages"] > 0 for row in summary["topics"].values())
    assert summary["figures"]["draw_rate_hz"] > 0


@pytest.mark.thorough
def test_its_recording_runs_again(demo):
    out, _ = demo
    replay = ["rosrun", "rpbi_utils", "replay", str(out / "recording.bag"), "--quiet"]
    done = subprocess.run(replay, capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.fullmatch(r"\d+ states agree over \d{4,} ticks\n", done.stdout)


def test_table_has_all_joints_by_name_moving_from_rest(demo):
    out, _ = demo
    table = pd.read_parquet(out / "joint_states.parquet", engine="fastparquet")
    for joint in JOINTS:
        assert {f"position/{joint}", f"velocity/{joint}", f"effort/{joint}"} <= set(table.columns)
        assert table[f"position/{joint}"].std() > 0.01
        assert abs(table[f"velocity/{joint}"].iloc[:10]).max() < 0.02, "it begins at rest"
    assert table.index.is_monotonic_increasing


def test_the_arm_pushes_the_box(demo):
    out, run = demo
    contacts = bag_to_dataframes(out / "recording.bag", "/rpbi/box/contacts")["/rpbi/box/contacts"]
    by_arm = contacts[contacts["other_body"] == "kuka_lwr"]
    assert set(by_arm["other_link"]) == {"end_effector_ball"}
    figures = json.loads((out / "summary.json").read_text())["figures"]
    assert figures["push_max_n"] == pytest.approx(by_arm["normal_force"].groupby(level=0).sum().max(), abs=0.01)
    friction = 0.8 * 9.81 * 0.7 * 0.9  # mass, gravity, and both bodies' friction
    assert friction / 2 < figures["push_mean_n"] < friction * 2


def test_the_camera_sees_something(demo):
    out, _ = demo
    colours = Image.open(out / "colour.png").convert("RGB").getcolors(maxcolors=640 * 480)
    assert Image.open(out / "colour.png").size == (640, 480)
    assert len(colours) > 200


@pytest.fixture
def command(monkeypatch):
    """The command in this process, which keeps its own handlers of signals."""
    monkeypatch.setattr("rpbi_examples.console.demo.ENDINGS", ())
    return command_of("rpbi_examples.console.demo")


def test_bad_arguments_are_named(command, capsys):
    with pytest.raises(SystemExit, match="2"):
        command.run(["--seconds", "0"])
    assert "--seconds: expected 2 to 3600, got 0" in capsys.readouterr().err


def test_unwritable_folder_is_reported_in_one_line(command, capsys):
    assert command.run(["--out", "/proc/x"]) == 1
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("demo: ") and "'/proc/x'" in line


def _processes_with_master(port: str) -> list[str]:
    """Returns the ids of the processes that were started to use the master at a port."""
    wanted = re.compile(rf"(^|\0)ROS_MASTER_URI=[^\0]*:{port}/?\0")
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):  # it has just ended, or is somebody else's
            if wanted.search(path.read_text(errors="replace")):
                found.append(path.parent.name)
    return found


@pytest.mark.thorough
def test_sigterm_closes_the_bag_and_leaves_no_process(tmp_path):
    out, log = tmp_path / "out", tmp_path / "demo.log"
    command = ["rosrun", "rpbi_examples", "demo.py", "--headless", "--seconds", "600", "--out", str(out)]
    with open(log, "w") as file:
        process = subprocess.Popen(command, stdout=file, stderr=subprocess.STDOUT, start_new_session=True)
    try:
        wait_until(lambda: process.poll() is not None or "recording 600 s" in log.read_text(), "it records")
        port = re.search(r"ROS_MASTER_URI=http://127\.0\.0\.1:(\d+)", log.read_text())[1]
        assert len(_processes_with_master(port)) >= 4, "roslaunch, the master, the simulator, the recorder"
        process.send_signal(signal.SIGTERM)
        assert process.wait(60.0) == 128 + signal.SIGTERM, log.read_text()
    finally:
        process.kill()
    wait_until(lambda: not _processes_with_master(port), "all have ended")
    assert (out / "recording.bag").exists()
    assert "Traceback" not in log.read_text()
