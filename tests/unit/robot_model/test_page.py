"""The page of the package, run without ROS and PyBullet."""

from __future__ import annotations

import pytest
from page_blocks import blocks_of
from page_runs import run_blocks

ABSENT = ("pybullet", "pybullet_data", "rospy", "rpbi")
FIRST, SECOND = blocks_of("docs/robot_model.md", "python")


def test_the_page_leads_from_a_urdf_to_a_jacobian(tmp_path):
    assert len([line for line in FIRST.text.splitlines() if line.strip()]) <= 20
    lines = run_blocks([FIRST], tmp_path, exclude=ABSENT)[0].splitlines()
    assert [float(word) for word in lines[0].split()] == pytest.approx([7, -2.094, 2.094], abs=1e-3)
    assert len(lines[1].strip("[]").split()) == 3
    assert lines[2].startswith("Pose(position=(")


def test_the_page_measures_a_distance_without_the_guard(tmp_path):
    pytest.importorskip("hppfcl")
    modules = "import sys\nprint(sorted(name for name in sys.modules if name.startswith('safe_robot')))"
    second = SECOND._replace(text=f"{SECOND.text}\n{modules}")
    distance, gradient, others = run_blocks([FIRST, second], tmp_path, exclude=ABSENT)[1].splitlines()
    assert 0.0 < float(distance.split()[0]) < 1.0
    assert len(gradient.strip("[]").split()) == 7
    assert others == "[]"
