"""The blocks of docs/mpc.md run, one after the other in one process."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)


def test_code_blocks_of_the_page_give_the_documented_results(tmp_path):
    blocks = BLOCK.findall((ROOT / "docs/mpc.md").read_text())
    (tmp_path / "script.py").write_text("\n".join(blocks))
    clean = ["env", "-i", "PATH=/usr/local/bin:/usr/bin:/bin", f"HOME={tmp_path}", str(ROOT / ".venv/bin/python")]
    done = subprocess.run([*clean, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    place, counts, pushed, is_cheaper = done.stdout.strip().splitlines()[-4:]
    assert float(place.strip("[]")) == pytest.approx(0.5, abs=0.02)
    assert counts.startswith("{'solved': 75,")
    finished, error_mm = pushed.split()
    assert finished == "True" and float(error_mm) < 15.0
    assert is_cheaper == "True", "the last plan costs less than the first"
    assert (tmp_path / "goto/cycles.csv").exists()
