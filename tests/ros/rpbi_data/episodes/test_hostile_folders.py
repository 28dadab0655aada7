"""Hostile folders of episodes, one of each kind, through their readers; see `dev/robustness/episode_folders.py`."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from ros_system import support_on_path

ROOT = Path(__file__).resolve().parents[4]
READERS = ("verify", "export --to robomimic", "episodes --relabel")

CONTROL = """
import importlib, os, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from robustness.hostile_episodes.makers import Hostile
from robustness.hostile_episodes.trial import trials

def writes(demos):
    (demos / "/../../outside/new".lstrip("/")).write_text("x")

def opens_for_writing(demos):
    os.close(os.open("/tmp/some/where", os.O_WRONLY))

def changes_through_a_link(demos):
    (demos / "link").symlink_to(demos.parents[1] / "outside/secret.obj")
    with open(demos / "link", "a") as file:
        file.write("x")

place = Path("place").absolute()
(place / "inside/demos").mkdir(parents=True)
(place / "outside").mkdir()
(place / "outside/secret.obj").write_text("a secret")
os.environ["XDG_CACHE_HOME"] = str(place / "cache")
readers = {
    "writes": writes,
    "opens": opens_for_writing,
    "link": changes_through_a_link,
    "imports": lambda _: importlib.import_module("canary_module"),
    "traceback": lambda _: 1 / 0,
    "harmless": lambda demos: (demos / "x").write_text("x"),
}
hostile = Hostile(0, "", place / "inside/demos", place / "outside")
print(*(trial.verdict for _, trial in trials(hostile, readers)))
"""


def _run(*command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, **support_on_path(), "TMPDIR": str(folder)}
    return subprocess.run([sys.executable, *command], capture_output=True, text=True, env=environment, cwd=folder)


@pytest.mark.thorough
def test_hostile_folders_are_taken_or_refused_in_words(tmp_path: Path) -> None:
    program = str(ROOT / "dev/robustness/episode_folders.py")
    done = _run(program, "--first", "20", "--count", "20", "--readers", *READERS, folder=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = [line.strip("| ").split(" | ") for line in done.stdout.splitlines() if line.startswith("| ")][1:]
    assert [row[:2] for row in rows] == [[name, "20"] for name in READERS]
    assert all(row[4:8] == ["0"] * 4 for row in rows)
    assert all(int(row[2]) for row in rows), "some are taken"


def test_trial_detects_each_forbidden_effect(tmp_path: Path) -> None:
    done = _run("-c", CONTROL, str(ROOT / "dev"), folder=tmp_path)
    assert done.stdout.split() == ["outside", "outside", "outside", "code", "traceback", "taken"], done.stderr
