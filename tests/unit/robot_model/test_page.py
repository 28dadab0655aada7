"""The page of the package, run without ROS and PyBullet."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
BLOCKED = "import sys\nsys.modules.update(dict.fromkeys(('pybullet', 'pybullet_data', 'rospy', 'rpbi')))\n"
BLOCKS = re.findall(r"```python\n(.*?)```", (ROOT / "docs/robot_model.md").read_text(), re.DOTALL)


def lines_of(program: str, home: Path) -> list[str]:
    """Returns the output of a program that can import neither ROS nor PyBullet."""
    clean = ["env", "-i", "PATH=/usr/local/bin:/usr/bin:/bin", f"HOME={home}", str(ROOT / ".venv/bin/python"), "-"]
    done = subprocess.run(clean, input=BLOCKED + program, cwd=home, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_the_page_leads_from_a_urdf_to_a_jacobian(tmp_path):
    assert len([line for line in BLOCKS[0].splitlines() if line.strip()]) <= 20
    lines = lines_of(BLOCKS[0], tmp_path)
    assert [float(word) for word in lines[0].split()] == pytest.approx([7, -2.094, 2.094], abs=1e-3)
    assert len(lines[1].strip("[]").split()) == 3
    assert lines[2].startswith("Pose(position=(")


def test_the_page_measures_a_distance_without_the_guard(tmp_path):
    pytest.importorskip("hppfcl")
    program = "".join(BLOCKS) + "print(sorted(name for name in sys.modules if name.startswith('safe_robot')))"
    *_, distance, gradient, others = lines_of(program, tmp_path)
    assert 0.0 < float(distance.split()[0]) < 1.0
    assert len(gradient.strip("[]").split()) == 7
    assert others == "[]"
