"""Hostile data sets of each format through `check_dataset`; `dev/robustness/datasets.py` checks 500 of each."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from ros_system import support_on_path

ROBUSTNESS = Path(__file__).resolve().parents[4] / "dev/robustness"


@pytest.mark.parametrize("count", [4, pytest.param(12, marks=pytest.mark.thorough)])
def test_hostile_datasets_are_checked_in_words(tmp_path: Path, count: int) -> None:
    environment = {**os.environ, **support_on_path(), "TMPDIR": str(tmp_path)}
    command = [sys.executable, str(ROBUSTNESS / "datasets.py"), "--first", "3000", "--count", str(count)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = [line.split(" | ") for line in done.stdout.splitlines() if line.startswith("| ")][1:]
    assert [row[1] for row in rows] == [str(count)] * 3
    assert sum(int(row[2]) for row in rows) and all(int(row[3]) for row in rows), "some are good, and some have faults"


def test_code_in_images_runs_in_a_reader_without_checks(exported, tmp_path, run, monkeypatch) -> None:
    sys.path.insert(0, str(ROBUSTNESS.parent))
    try:
        from robustness.hostile_datasets.lerobot import Code
    finally:
        del sys.path[0]
    folder = tmp_path / "dataset"
    subprocess.run(["cp", "-r", exported("lerobot"), folder], check=True)
    path = folder / "rpbi/episode_000000.npz"
    np.savez(path, **{"observation.images.camera_colour": np.array([Code(folder)], object)})
    code, text = run("check_dataset", folder)
    assert code == 1 and "rpbi/episode_000000.npz cannot be read" in text and not (tmp_path / "canary").exists()
    with np.load(path, allow_pickle=True) as data:  # negative control
        assert data["observation.images.camera_colour"].shape == (1,)
    assert (tmp_path / "canary").exists()
