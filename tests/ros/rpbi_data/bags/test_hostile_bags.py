"""Hostile topics, indices, chunks, bytes and sessions, through each reader and replay.

`dev/robustness/bags.py` reads a thousand, of all kinds; definitions, names and columns are in unit tests.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from ros_system import support_on_path

ROBUSTNESS = Path(__file__).resolve().parents[4] / "dev/robustness"
FIRST_SEED = 5016


@pytest.mark.thorough
def test_a_hostile_bag_is_taken_or_refused_in_words(tmp_path: Path) -> None:
    seeds = ["--first", str(FIRST_SEED), "--count", "8"]
    environment = {**os.environ, **support_on_path(), "TMPDIR": str(tmp_path)}
    command = [sys.executable, str(ROBUSTNESS / "bags.py"), *seeds]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = [line.split(" | ") for line in done.stdout.splitlines() if line.startswith("| ")][1:]
    assert len(rows) == 5 and all(row[1] == "8" for row in rows)
    assert any(int(row[2]) for row in rows) and all(int(row[3]) for row in rows), "some are taken, and some refused"
