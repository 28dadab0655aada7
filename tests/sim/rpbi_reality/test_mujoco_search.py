"""The search for MuJoCo's settings on tosses that MuJoCo itself has simulated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from real_contacts import toss_arrays, write

from rpbi_reality.evaluation import world_file
from rpbi_reality.identification.identify import read_fit
from rpbi_reality.identification.mujoco_search import MujocoEvaluator, fit_mujoco, settings
from rpbi_reality.tosses.mujoco_cube import MujocoCube
from rpbi_reality.tosses.toss_data import Start, TossData

CONFIG = read_fit(Path(world_file("tosses/fit_mujoco.yaml")))
FIRST = {name: each.first for name, each in CONFIG.parameters.items()}
TRUE = {**FIRST, "friction": 0.15, "centre_z": 0.0055}


@pytest.fixture
def tosses(tmp_path):
    """Three tosses of 50 frames with friction 0.15."""
    cube, random = MujocoCube(settings(TRUE), 148.0), np.random.default_rng(0)
    arrays = toss_arrays(3, 50)
    arrays["start_position"] = np.tile([0.0, 0.0, 0.12], (3, 1))
    arrays["start_linear_velocity"] = random.normal(0.0, 1.0, (3, 3)) * [1.0, 1.0, 0.0]
    arrays["start_angular_velocity"] = random.normal(0.0, 4.0, (3, 3))
    starts = [Start(*(arrays[f"start_{field}"][i] for field in Start._fields)) for i in range(3)]
    arrays["position"], arrays["quaternion"] = map(np.concatenate, zip(*(cube(start, 50) for start in starts)))
    return write(tmp_path / "cube_tosses.npz", arrays)


def test_true_settings_have_no_error_and_others_have(tosses):
    evaluate = MujocoEvaluator(CONFIG, TossData.read(tosses))
    true, first = evaluate([TRUE, FIRST], [0, 1, 2])
    assert true.runs.max() < 1e-6 and first.runs.min() > 1e-3
    assert evaluate.count == 2


def test_the_search_finds_the_friction(tosses, tmp_path):
    few = {"friction": {"set": "mujoco.friction", "bounds": [0.1, 0.25], "start": 0.2}}
    fixed = {
        name: {"set": f"mujoco.{name}", "bounds": [0.9999 * value, 1.0001 * value], "start": value}
        for name, value in TRUE.items()
        if name != "friction" and value > 0.0
    }
    data = {
        "method": "cmaes",
        "objective": "mean_error",
        "runs": {"count": 2},
        "evaluations": 150,
        "measured": {"cube": {"object": "cube", "position_sigma": 0.0089, "rotation_sigma": 0.061}},
        "parameters": {**few, **fixed},
    }
    (tmp_path / "fit.yaml").write_text(yaml.safe_dump(data))
    found = fit_mujoco(tosses, tmp_path / "fit.yaml")
    assert found.values["friction"] == pytest.approx(0.15, abs=0.004)
    assert found.held_out[0] < 3.0  # percent of the width
