"""The container is made as ./rpbi makes any machine; tests/fresh_machine.sh executes it without Docker."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.thorough

ROOT = Path(__file__).resolve().parent.parent


def _patterns(name: str) -> list[str]:
    return [line for line in (ROOT / name).read_text().splitlines() if line and not line.startswith("#")]


def test_fresh_machine_understands_the_dockerfile():
    answer = subprocess.run([ROOT / "tests" / "fresh_machine.sh", "--steps"], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    release, folder, *steps, start = answer.stdout.splitlines()
    assert steps == ["./rpbi setup"], "one path of installation"
    assert start.startswith("./rpbi demo") and folder == "in /rpbi" and release.startswith("debian ")


def test_fresh_machine_refuses_a_dockerfile_with_unknown_steps(tmp_path):
    (tmp_path / "tests").mkdir()
    (tmp_path / "docker").mkdir()
    script = tmp_path / "tests" / "fresh_machine.sh"
    script.write_text((ROOT / "tests" / "fresh_machine.sh").read_text())
    (tmp_path / "docker" / "Dockerfile").write_text("FROM debian:bookworm\nENV DEBUG=1\n")
    answer = subprocess.run(["bash", script, "--steps"], capture_output=True, text=True)
    assert answer.returncode == 1
    assert "docker/Dockerfile: ENV is not known here" in answer.stderr


def test_files_ignored_by_git_are_not_in_the_image():
    """`/x/` of git is `x` of Docker, where a pattern without a slash is that of the top folder alone."""
    wanted = {re.sub(r"^/", "", line) if "/" in line[:-1] else f"**/{line}" for line in _patterns(".gitignore")}
    missing = {line.rstrip("/") for line in wanted} - set(_patterns(".dockerignore"))
    assert missing == set()
