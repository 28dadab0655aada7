"""Scenes in this process: episodes by seed, tasks of Gymnasium, scores, and what is wrong."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import writing_scene
from PIL import Image
from ros_system import wait_until

from custom_ros_tools.console.argument import UsageError
from custom_ros_tools.errors import InterfaceError, PhysicsError, UnknownNameError
from robot_model.geometry import Pose
from rpbi.gym.env import WorldEnv
from rpbi_examples.console import score as command
from rpbi_examples.scenes import evaluation as score
from rpbi_examples.scenes.evaluation import SeedResult, summary, write_failures
from rpbi_examples.scenes.parts.arm import between, smooth
from rpbi_examples.scenes.scene import SceneResult
from rpbi_examples.scenes.task import do, make_env, run_episode

CONSOLE = Path(__file__).resolve().parents[4] / "devel/lib/custom_ros_tools/console"
SCENE = "writing_scene:Writing"


@pytest.fixture
def env():
    found = make_env(SCENE)
    yield found
    found.close()


def has_processes(group: int) -> bool:
    """Returns whether a process of a group runs."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def start_score(folder: Path, path: Path, *options: str, **environment: str) -> subprocess.Popen[str]:
    """Starts a score in a folder and in a process group of its own, with a folder of modules before all others."""
    variables = {**os.environ, **environment, "PYTHONPATH": os.pathsep.join((str(path), *sys.path))}
    command = [sys.executable, str(CONSOLE), "score", *options, "--jobs", "2"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, cwd=folder, env=variables, start_new_session=True, **pipes)


def test_seed_gives_the_same_episode_in_any_order_and_process(env, tmp_path):
    first = run_episode(env, 5), env.world.state_hash()
    run_episode(env, 6)
    assert (run_episode(env, 5), env.world.state_hash()) == first
    begun = tmp_path / "begun"
    options = [SCENE, "--seeds", "5-500", "--json", "found.json"]
    process = start_score(tmp_path, Path(writing_scene.__file__).parent, *options, WRITING_BEGUN=str(begun))
    made = 2 + 5  # environments of both processes, and episodes
    wait_until(lambda: begun.exists() and len(begun.read_text().splitlines()) >= made, "episodes have ended")
    os.killpg(process.pid, signal.SIGINT)
    printed, complaints = process.communicate(timeout=60.0)
    assert process.returncode == 130 and "Traceback" not in complaints, complaints
    found = json.loads((tmp_path / "found.json").read_text())
    row = found["rows"][0]
    assert row["seed"] in (5, 6), "with two workers, the first one of these to end"
    time_s = run_episode(env, row["seed"]).time_s
    assert (row["state_hash"], row["time_s"]) == (env.world.state_hash(), time_s)
    assert f"{SCENE}: {found['success']} of {found['of']} ({found['seeds']} of 496 seeds)" in printed
    wait_until(lambda: not has_processes(process.pid), "no process of it is left")


def test_a_score_without_an_extra_names_it_in_one_line(tmp_path):
    (tmp_path / "pinocchio.py").write_text("raise ImportError('none here', name='pinocchio')\n")
    process = start_score(tmp_path, tmp_path, "talos", "--seeds", "1-2")
    printed, complaints = process.communicate(timeout=120.0)
    lines = [line for line in complaints.splitlines() if line.strip()]
    assert process.returncode == 1 and not printed
    assert "'pinocchio' is not installed: ./rpbi setup ik" in lines[-1] and "Traceback" not in complaints, complaints


@pytest.mark.quick
def test_the_tip_goes_where_the_scene_leads_it(env):
    result = run_episode(env, 5)
    assert result.success and result.figures["error [mm]"] < 2.0
    assert result.time_s == pytest.approx(0.02 + 2.0 + 0.02, abs=0.05)


def test_the_scene_of_the_docs_succeeds(tmp_path, monkeypatch):
    text = (CONSOLE.parents[3] / "docs/scenes.md").read_text()
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


def test_failing_world_gives_a_failed_row_and_is_replaced(tmp_path, monkeypatch, capsys):
    worlds, step = set(), WorldEnv.step

    def fail_first(self, action):
        worlds.add(self.world)
        if len(worlds) == 1 and self.world.clock.tick > 100:
            raise PhysicsError("not finite any more: the tip")
        return step(self, action)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(WorldEnv, "step", fail_first)
    assert command.score(SCENE, seeds="4-5", json=tmp_path / "score.json", jobs=1) == 0
    assert "failed: not finite any more: the tip" in capsys.readouterr().out
    found = json.loads((tmp_path / "score.json").read_text())
    assert (found["success"], found["of"], len(worlds)) == (1, 2, 2)
    broken, whole = found["rows"]
    assert (broken["success"], broken["done"], broken["of"]) == (False, 0, 1) and "error [mm]" not in broken
    assert whole["success"] and whole["state_hash"]


def test_a_deed_that_the_world_refuses_is_named(env):
    env.reset(seed=5)
    env.task.scene.put("kuka_lwr/target", {"lwr_arm_0_joint": math.nan})
    with pytest.raises(InterfaceError, match="^InputValue kuka_lwr/target: .*finite"):
        do(env.world, *env.task.scene.take_changes())


def test_a_good_score_leaves_no_pictures_of_failures(tmp_path):
    path = tmp_path / "failures.png"
    path.touch()
    good = SeedResult(5, SceneResult(True, 1, 1, 2.0, {}), "", None)
    assert not write_failures(path, [good]) and not path.exists()
    assert summary(SCENE, [good])["success"] == 1


@pytest.mark.parametrize("seeds", ["", "a", "9-8", "1-", "-3"])
def test_wrong_seeds_are_named(seeds):
    with pytest.raises(UsageError, match="--seeds: expected seeds such as 1-100, or one"):
        command.score("dual_arm", seeds=seeds)


def test_an_unknown_scene_is_named():
    with pytest.raises(UnknownNameError, match="unknown scene 'cop': known are .*; did you mean 'cup'"):
        command.score("cop")


def test_paths_are_straight_from_rest_to_rest():
    shares = np.linspace(0.0, 1.0, 1001)
    velocity = np.gradient([smooth(share) for share in shares], shares)
    assert velocity[0] < 1e-4 and velocity[-1] < 1e-4 and velocity.max() == pytest.approx(1.875, abs=1e-3)
    half = between(Pose(), Pose((1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)), 0.5)
    assert half.position == (0.5, 0.0, 0.0) and np.allclose(np.abs(half.quat_xyzw), (0.0, 0.0, 0.5**0.5, 0.5**0.5))
