"""Scenes in this process: episodes by seed, tasks of Gymnasium, scores, and what is wrong."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import writing_scene
from PIL import Image

from custom_ros_tools.console.argument import UsageError
from custom_ros_tools.errors import UnknownNameError
from robot_model.geometry import Pose
from rpbi_examples.ros.console import score as command
from rpbi_examples.scenes import score
from rpbi_examples.scenes.parts.arm import between, smooth
from rpbi_examples.scenes.score import run_seeds, summary, write_failures
from rpbi_examples.scenes.task import make_env, run_episode

CONSOLE = Path(__file__).resolve().parents[4] / "src/custom_ros_tools/nodes/console"
SCENE = "writing_scene:Writing"


@pytest.fixture
def env():
    found = make_env(SCENE)
    yield found
    found.close()


def test_a_seed_leads_to_the_same_episode_in_any_order_and_process(env, tmp_path, monkeypatch):
    first = run_episode(env, 5), env.world.state_hash()
    run_episode(env, 6)
    assert (run_episode(env, 5), env.world.state_hash()) == first
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((str(Path(writing_scene.__file__).parent), *sys.path)))
    options = ["--seeds", "5-6", "--jobs", "2", "--json", "found.json"]
    subprocess.run([sys.executable, str(CONSOLE), "score", SCENE, *options], cwd=tmp_path, check=True)
    row, _ = json.loads((tmp_path / "found.json").read_text())["rows"]
    assert (row["state_hash"], row["time_s"]) == (first[1], first[0].time_s)


def test_the_tip_goes_where_the_scene_leads_it(env):
    result = run_episode(env, 5)
    assert result.success and result.figures["error [mm]"] < 2.0
    assert result.time_s == pytest.approx(0.02 + 2.0 + 0.02, abs=0.05)


def test_the_scene_of_the_docs_succeeds(tmp_path, monkeypatch):
    text = (CONSOLE.parents[3] / "docs/examples.md").read_text()
    (code,) = re.findall(r"```python\n# my_lab/lift.py\n(.*?)```", text, re.DOTALL)
    (tmp_path / "lift.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    found = make_env("lift:Lift")
    assert run_episode(found, 1).success
    found.close()


def test_a_target_out_of_reach_fails_with_its_place(env, monkeypatch):
    monkeypatch.setattr(writing_scene, "WAY", (5.0, 0.0, 0.0))
    result = run_episode(env, 5)
    assert not result.success
    assert result.reason.startswith("kuka_lwr: (") and "out of reach" in result.reason


def test_an_episode_that_takes_too_long_has_failed(env, monkeypatch):
    monkeypatch.setattr(writing_scene.Writing, "longest_s", 0.5)
    assert run_episode(env, 5).reason == "not done after 0.5 s"


def test_scores_are_tables_json_and_pictures(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(writing_scene, "TOLERANCE_M", 0.0)
    monkeypatch.setattr(score, "MAX_PICTURES", 1)
    assert command.score(SCENE, seeds="7-8", json=tmp_path / "score.json", jobs=1) == 0
    printed = capsys.readouterr().out
    assert f"{SCENE}: 0 of 2" in printed and printed.count("failed") >= 2
    assert "ends of failed episodes, the first 1 of 2: " in printed
    found = json.loads((tmp_path / "score.json").read_text())
    assert (found["success"], found["of"]) == (0, 2) and [row["seed"] for row in found["rows"]] == [7, 8]
    sheet = Image.open(tmp_path / "out/score/writing_scene.Writing_failures.png")
    assert sheet.size == (320, 240) and np.asarray(sheet).std() > 10.0


def test_a_good_score_leaves_no_pictures_of_failures(tmp_path):
    path = tmp_path / "failures.png"
    path.touch()
    results = list(run_seeds(SCENE, [5], 1))
    assert not write_failures(path, results) and not path.exists()
    assert summary(SCENE, results)["success"] == 1


@pytest.mark.parametrize("seeds", ["", "a", "9-8", "1-", "-3"])
def test_wrong_seeds_are_named(seeds):
    with pytest.raises(UsageError, match="--seeds: expected seeds such as 1-100, or one"):
        command.score("dual_arm", seeds=seeds)


def test_an_unknown_scene_is_named():
    with pytest.raises(UnknownNameError, match="unknown scene 'cop': known are .*; did you mean 'cup'"):
        command.score("cop")


def test_ways_are_from_rest_to_rest_and_straight():
    shares = np.linspace(0.0, 1.0, 1001)
    velocity = np.gradient([smooth(share) for share in shares], shares)
    assert velocity[0] < 1e-4 and velocity[-1] < 1e-4 and velocity.max() == pytest.approx(1.875, abs=1e-3)
    half = between(Pose(), Pose((1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)), 0.5)
    assert half.position == (0.5, 0.0, 0.0) and np.allclose(np.abs(half.quat_xyzw), (0.0, 0.0, 0.5**0.5, 0.5**0.5))
