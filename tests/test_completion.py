"""Completion in bash, driven as a user does: an interactive bash in a terminal, letters and tabs."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from terminal import PROMPT, Terminal

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "dev"))

from robustness.completion import UNGUARDED, make_launch, trial  # noqa: E402


@pytest.fixture(scope="module")
def terminal(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Terminal]:
    folder = tmp_path_factory.mktemp("completion")
    (folder / "my worlds").mkdir()
    (folder / "my worlds" / "lab.yaml").touch()
    (folder / "notes.txt").touch()
    (folder / "run.bag").touch()
    (folder / "mine.launch").write_text('<launch>\n  <arg name="speed" default="1"/>\n</launch>\n')
    terminal = Terminal(folder)
    yield terminal
    terminal.close()


@pytest.mark.parametrize(
    ("typed", "line"),
    [
        ("./rpbi lau\t", "./rpbi launch"),
        (f"{ROOT}/rpbi che\t", f"{ROOT}/rpbi check"),
        ("./rpbi launch gras\t", "./rpbi launch grasp_example"),
        ("./rpbi launch grasp_example real\t0", "./rpbi launch grasp_example real_time_factor:=0"),
        ("./rpbi launch grasp_example gui:=true headl\ttrue", "./rpbi launch grasp_example gui:=true headless:=true"),
        ("./rpbi launch mi\tsp\t2", "./rpbi launch mine.launch speed:=2"),
        ("./rpbi docs --h\t", "./rpbi docs --help"),
        ("./rpbi test --a\t", "./rpbi test --all"),
        ("./rpbi demo --head\t", "./rpbi demo --headless"),
        ("./rpbi demo --headless --sec\t", "./rpbi demo --headless --seconds"),
        ("./rpbi check my\tl\t", "./rpbi check my worlds/lab.yaml"),
        ("./rpbi replay r\t", "./rpbi replay run.bag"),
        ("./rpbi spawn --type vi\t", "./rpbi spawn --type visual"),
        ("./rpbi setup as\t", "./rpbi setup assets"),
        ("./rpbi bench gra\t", "./rpbi bench grasp"),
        ("./rpbi launch nothing_of_this\t", "./rpbi launch nothing_of_this"),
    ],
)
def test_a_tab_completes(terminal, typed, line):
    assert terminal.completed(typed) == line


def test_a_tab_offers_all_commands(terminal):
    usage = subprocess.run([ROOT / "rpbi"], capture_output=True, text=True).stdout
    assert terminal.offered("./rpbi \t") == set(re.findall(r"^  (\w+) ", usage, re.MULTILINE))


def test_arguments_of_a_launch_file_are_offered(terminal):
    solver, windows = {"drag:=", "ik:=", "ik_hz:="}, {"foxglove:=", "gui:=", "headless:=", "ros2:=", "rviz:=", "view:="}
    expected = (
        solver | windows | {"guard:=", "real_robot:=", "real_time_factor:=", "stand_in:=", "start:=", "use_sim_time:="}
    )
    assert terminal.offered("./rpbi launch kuka_lwr_ik_example \t") == expected


def test_other_files_are_not_offered(terminal):
    assert terminal.offered("./rpbi replay \t") == {"my", "worlds/", "run.bag"}


def test_no_code_in_a_launch_file_runs(tmp_path):
    lines = [make_launch(seed, tmp_path) for seed in range(24)]
    terminal = Terminal(tmp_path)
    assert {trial(terminal, tmp_path, line)[0] for line in lines} == {"fine"}
    terminal.send(UNGUARDED)
    terminal.read_until(f"\n{PROMPT}")
    assert trial(terminal, tmp_path, lines[0])[0] == "code", "the control"
    terminal.close()
