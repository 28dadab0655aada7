"""A sample of the hostile files that `dev/robustness/try_files.py` makes, and that it sees what goes wrong."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pybullet
import pytest

from custom_ros_tools.errors import InterfaceError

ROOT = Path(__file__).resolve().parents[4]
sys.path.append(str(ROOT / "dev"))

from robustness import trials  # noqa: E402


@pytest.mark.quick
def test_every_reader_takes_or_refuses_a_sample_of_hostile_files():
    command = [sys.executable, str(ROOT / "dev/robustness/try_files.py"), "--share", "0.01", "--first", "5000"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-3000:]
    rows = {line.split()[1]: line.split("|")[2:6] for line in done.stdout.splitlines() if line.startswith("| ")}
    numbers = {kind: list(map(int, rows[kind])) for kind in ("urdf", "mesh", "yaml")}
    assert [number for number, *_ in numbers.values()] == [20, 5, 10]
    assert all(taken + refused == number for number, _, taken, refused in numbers.values())
    assert all(sum(row[column] for row in numbers.values()) > 3 for column in (2, 3)), "of both there are some"


def _two_parents(folder):
    links = "".join(f'<link name="{name}"/>' for name in "abc")
    joints = "".join(
        f'<joint name="{name}" type="fixed"><parent link="{name}"/><child link="c"/></joint>' for name in "ab"
    )
    (folder / "robot.urdf").write_text(f'<robot name="r">{links}{joints}</robot>')
    pybullet.connect(pybullet.DIRECT)
    pybullet.loadURDF(str(folder / "robot.urdf"))


def _refuse(folder):
    raise InterfaceError("")


READERS = {
    "a signal": (_two_parents, "signal 11"),
    "a traceback": (lambda folder: [][1], "traceback"),
    "an exit": (lambda folder: sys.exit(), "traceback"),
    "code": (lambda folder: (folder / "canary").touch(), "code"),
    "no reason": (_refuse, "silent"),
    "a hang": (lambda folder: os.read(os.pipe()[0], 1), "hang"),
}


def test_trials_detect_planted_failures(tmp_path, monkeypatch):
    cases = [*READERS.values()]

    def made(kind, seed, folder):
        return ("urdfs", folder), {"world": lambda: cases[seed][0](folder)}

    monkeypatch.setattr(trials, "hostile", made)
    monkeypatch.setattr(trials, "LONGEST_S", 3.0)
    found = list(trials.outcomes("urdf", range(len(cases)), tmp_path))
    assert [each.verdict for each in found] == [verdict for _, verdict in cases]
