"""The command `bag_to_table`, as its users run it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Float64

WriteBag = Callable[..., Path]
NODE = Path(__file__).resolve().parents[4] / "devel/lib/rpbi_utils/bag_to_table"


def _run(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(NODE), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def _read(path: Path) -> pd.DataFrame:
    return pd.read_parquet(path, engine="fastparquet")


@pytest.fixture
def bag(write_bag: WriteBag) -> Path:
    states = [("/kuka/joint_states", JointState(name=["a", "b"], position=[index, -index])) for index in range(10)]
    return write_bag([*states, ("/target", Float64(1.5)), ("/image", Image(data=b"\0\1"))], name="run.bag")


@pytest.mark.quick
def test_each_topic_becomes_a_listed_parquet_file_near_the_bag(bag: Path) -> None:
    done = _run(bag)
    assert done.returncode == 0, done.stderr
    folder = bag.parent / "run_tables"
    assert sorted(path.name for path in folder.iterdir()) == ["kuka.joint_states.parquet", "target.parquet"]
    table = _read(folder / "kuka.joint_states.parquet")
    assert table.index.name == "time"
    assert list(table["position/b"]) == [-index for index in range(10)]
    header, *lines = [line.split() for line in done.stdout.splitlines()]
    assert header == ["topic", "rows", "columns", "size", "file"]
    assert [line[:3] for line in lines] == [["/kuka/joint_states", "10", "5"], ["/target", "1", "2"]]
    assert lines[0][-1] == str(folder / "kuka.joint_states.parquet")
    assert "bag_to_table: left out, as they hold binary data: /image" in done.stderr
    assert "messages/s" in done.stderr  # the progress bar


def test_csv_goes_where_it_is_wanted(bag: Path, tmp_path: Path) -> None:
    done = _run(bag, "--format", "csv", "--out", tmp_path / "deep/inside", "--topics", "/target")
    assert done.returncode == 0, done.stderr
    (path,) = (tmp_path / "deep/inside").iterdir()
    assert path.read_text() == "time,record_time,data\n100.01,100.01,1.5\n"


def test_images_come_when_asked_for(bag: Path, tmp_path: Path) -> None:
    assert _run(bag, "--out", tmp_path / "all", "--images").returncode == 0
    assert _run(bag, "--out", tmp_path / "one", "--topics", "/image").returncode == 0
    assert len(list((tmp_path / "all").iterdir())) == 3
    for folder in ("all", "one"):
        assert _read(tmp_path / folder / "image.parquet")["data"].iloc[0] == b"\0\1"


def test_quiet_is_silent(bag: Path) -> None:
    done = _run(bag, "--quiet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_names_that_roslaunch_adds_do_no_harm(bag: Path) -> None:
    assert _run(bag, "--quiet", "__name:=bag_to_table", "__log:=/dev/null").returncode == 0


def test_every_fault_is_one_line_and_exit_code_1(bag: Path, write_bag: WriteBag, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "text.bag").write_text("text")
    problems = {
        "there is no such file": [tmp_path / "missing.bag"],
        "not a ROS 1 bag": [tmp_path / "text.bag"],
        "did you mean '/target'?": [bag, "--topics", "/targe"],
        "File exists": [bag, "--out", tmp_path / "file"],
        "'data' is binary and cannot be written as CSV": [bag, "--images", "--format", "csv"],
    }
    for message, arguments in problems.items():
        done = _run(*arguments, "--quiet")
        assert done.returncode == 1
        assert message in done.stderr
        assert done.stderr.startswith("bag_to_table: ")
        assert done.stderr.count("\n") == 1


def test_an_empty_bag_is_no_fault(write_bag: WriteBag) -> None:
    done = _run(write_bag([]))
    assert done.returncode == 0
    assert done.stdout == "no topic to write\n"
