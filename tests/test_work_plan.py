"""Which tests `./rpbi test` runs without options, with `--quick` and with `--all`; on a small suite, as users do."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.thorough
SUPPORT = Path(__file__).parent / "support/runs"
SUITE = """
import pathlib, pytest

def test_default():
    pass

@pytest.mark.quick
def test_quick():
    pass

@pytest.mark.thorough
def test_thorough():
    pass

@pytest.mark.parametrize("size", [1, pytest.param(1000, marks=pytest.mark.thorough)])
def test_sizes(size):
    pass

@pytest.mark.thorough
def test_thorough_once():
    mark = pathlib.Path(__file__).with_suffix(".mark")
    first = not mark.exists()
    mark.touch()
    assert not first
"""
DEFAULT = {"test_default", "test_quick", "test_sizes[1]"}
THOROUGH = {"test_thorough", "test_sizes[1000]", "test_thorough_once"}


def run_suite(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    (folder / "test_suite.py").write_text(SUITE)
    (folder / "pytest.ini").write_text(
        f"[pytest]\npythonpath = {SUPPORT}\naddopts = -p work_plan -p second_try -p no:cacheprovider\n"
        "markers =\n    quick\n    thorough\n    alone\n"
    )
    environment = os.environ | {"PYTHONPATH": f"{SUPPORT}:{os.environ.get('PYTHONPATH', '')}"}
    command = [sys.executable, "-m", "pytest", "-v", "-n1", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment)


def passed(done: subprocess.CompletedProcess[str]) -> set[str]:
    return set(re.findall(r"PASSED \S+::(\S+)", done.stdout))


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ((), DEFAULT),
        (("--quick",), {"test_quick"}),
        (("--all", "-k", "not once"), DEFAULT | THOROUGH - {"test_thorough_once"}),
        (("test_suite.py",), DEFAULT),
        (("test_suite.py::test_sizes",), {"test_sizes[1]"}),
        (("--all", "test_suite.py::test_thorough"), {"test_thorough"}),
    ],
    ids=["default", "quick", "all", "file", "test of a file", "all of a test"],
)
def test_thorough_tests_run_only_with_all(tmp_path, options, expected):
    done = run_suite(tmp_path, *options)
    assert done.returncode == 0, done.stdout
    assert passed(done) == expected


def test_a_thorough_test_chosen_without_all_is_deselected(tmp_path):
    done = run_suite(tmp_path, "test_suite.py::test_thorough")
    assert done.returncode == pytest.ExitCode.NO_TESTS_COLLECTED
    assert passed(done) == set()


def test_a_failed_thorough_test_is_run_again(tmp_path):
    done = run_suite(tmp_path, "--all")
    assert done.returncode == 0, done.stdout
    assert "5 passed, 1 flaky" in done.stdout


TIMED = """
import pathlib, time, pytest

@pytest.mark.{mark}
@pytest.mark.parametrize("number", range(4))
def test_timed(number):
    began_s = time.monotonic()
    time.sleep(0.3)
    pathlib.Path(__file__).with_suffix(f".{{number}}").write_text(f"{{began_s}} {{time.monotonic()}}")
"""


@pytest.mark.parametrize("mark", ["alone", "quick"])
def test_nothing_else_runs_beside_a_test_with_the_mark_alone(tmp_path, mark):
    """With another mark, tests of the two workers overlap."""
    (tmp_path / "test_marked.py").write_text(TIMED.format(mark=mark))
    (tmp_path / "test_other.py").write_text(TIMED.format(mark="quick"))
    done = run_suite(tmp_path, "-n2", "test_marked.py", "test_other.py")
    assert "8 passed" in done.stdout, done.stdout
    marked, others = (
        [tuple(map(float, (tmp_path / f"{name}.{number}").read_text().split())) for number in range(4)]
        for name in ("test_marked", "test_other")
    )
    overlaps = sum(
        begin < end_of_other and begin_of_other < end
        for begin, end in marked
        for begin_of_other, end_of_other in others
    )
    assert (overlaps == 0) == (mark == "alone")
