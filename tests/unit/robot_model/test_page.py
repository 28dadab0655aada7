"""The page of the package, run without ROS and PyBullet."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
BLOCKED = "import sys\nsys.modules.update(dict.fromkeys(('pybullet', 'pybullet_data', 'rospy', 'rpbi')))\n"


def test_the_page_leads_from_a_urdf_to_a_jacobian(tmp_path):
    (block,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/robot_model.md").read_text(), re.DOTALL)
    assert len([line for line in block.splitlines() if line.strip()]) <= 20
    clean = ["env", "-i", "PATH=/usr/local/bin:/usr/bin:/bin", f"HOME={tmp_path}", str(ROOT / ".venv/bin/python"), "-"]
    done = subprocess.run(clean, input=BLOCKED + block, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert [float(word) for word in lines[0].split()] == pytest.approx([7, -2.094, 2.094], abs=1e-3)
    assert len(lines[1].strip("[]").split()) == 3
    assert lines[2].startswith("Pose(position=(")
