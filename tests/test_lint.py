"""The code is clean by the settings in pyproject.toml."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Runs a Python module at the root of the workspace."""
    return subprocess.run([sys.executable, "-m", *arguments], cwd=ROOT, capture_output=True, text=True)


def test_ruff_finds_nothing() -> None:
    result = run("ruff", "check", "--no-cache", "--output-format", "concise", ".")
    assert result.returncode == 0, result.stdout + result.stderr


def test_files_are_formatted() -> None:
    result = run("ruff", "format", "--check", "--diff", "--no-cache", ".")
    assert result.returncode == 0, result.stdout + result.stderr


def test_mypy_finds_nothing() -> None:
    result = run("mypy", "--cache-dir", str(ROOT / ".rpbi" / "mypy"))
    assert result.returncode == 0, result.stdout + result.stderr


def test_catkin_lint_finds_nothing_in_packages_and_templates() -> None:
    command = ["catkin_lint", "--offline", "--strict", "-W1", str(ROOT / "src"), str(ROOT / "docs/templates")]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr


def conflict_markers(folder: Path) -> list[str]:
    """Returns the files below a folder that have lines of a merge that was not finished."""
    marker = re.compile(rb"^(<{7} |>{7} |={7}$)", re.MULTILINE)
    files = [path for path in folder.rglob("*") if path.is_file() and not path.is_symlink()]
    return [str(path.relative_to(folder)) for path in files if marker.search(path.read_bytes())]


def test_no_file_has_conflict_markers() -> None:
    folders = ("src", "docs", "tests", "dev", "docker", "requirements")
    assert [each for folder in folders for each in conflict_markers(ROOT / folder)] == []
    assert b"<" * 7 not in b"".join(path.read_bytes() for path in ROOT.iterdir() if path.is_file())


def test_conflict_markers_are_found(tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text("a\n<" + "<<<<<< HEAD\nb\n=" + "======\nc\n>" + ">>>>>> main\n")
    (tmp_path / "table.rst").write_text("========\nheading\n========\n")
    assert conflict_markers(tmp_path) == ["page.md"]
