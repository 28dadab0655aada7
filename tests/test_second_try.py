"""A failed test gets a second try by itself, and a run of many failures none; run as users do, on small suites."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.thorough
SUPPORT = Path(__file__).parent / "support/runs"
SUITE = """
import pathlib, pytest

def once(name):
    '''Fails at the first call in a folder, and never after.'''
    mark = pathlib.Path(__file__).parent / f"{name}.mark"
    if not mark.exists():
        mark.touch()
        raise RuntimeError(f"first time of {name}")
    print(f"second time of {name}")

@pytest.fixture
def closes_badly():
    yield
    once("teardown")

def test_passes():
    pass
"""
FAILS_ONCE = "def test_once_{0}():\n    once({0})\n"
FAILS_ALWAYS = "def test_always():\n    assert 1 == 2\n"
CRASHES_ONCE = """
def test_crash():
    try:
        once("crash")
    except RuntimeError:
        import os
        os._exit(1)
"""
FAILS_AT_ITS_END = "def test_end(closes_badly):\n    pass\n"


def run_suite(folder: Path, *tests: str, options: tuple[str, ...] = ()) -> subprocess.CompletedProcess[str]:
    (folder / "test_suite.py").write_text(SUITE + "\n".join(tests))
    (folder / "pytest.ini").write_text(
        f"[pytest]\npythonpath = {SUPPORT}\naddopts = -p second_try -p no:cacheprovider\n"
    )
    command = [sys.executable, "-m", "pytest", "-n2", *options, "test_suite.py"]
    environment = os.environ | {"PYTHONPATH": f"{SUPPORT}:{os.environ.get('PYTHONPATH', '')}"}
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment)


def closing_line(done: subprocess.CompletedProcess[str]) -> str:
    return done.stdout.rstrip().splitlines()[-1]


def test_three_that_fail_once_pass_as_flaky_with_both_outputs(tmp_path):
    done = run_suite(tmp_path, FAILS_ONCE.format(1), FAILS_ONCE.format(2), FAILS_AT_ITS_END)
    assert done.returncode == 0, done.stdout
    # The test whose teardown failed has passed before it did
    assert " 2 passed, 3 flaky in " in closing_line(done), done.stdout
    for words in ("first time of 1", "second time of 1", "first time of teardown", "flaky: test_suite.py::test_once_2"):
        assert words in done.stdout


@pytest.mark.parametrize(
    ("tests", "options", "counts"),
    [
        ([FAILS_ALWAYS], (), "1 failed, 1 passed"),
        ([FAILS_ALWAYS, FAILS_ONCE.format(1)], (), "1 failed, 1 passed, 1 flaky"),
        ([FAILS_ONCE.format(i) for i in range(4)], (), "4 failed, 1 passed"),
        ([FAILS_ONCE.format(1)], ("--strict",), "1 failed, 1 passed"),
        ([FAILS_ONCE.format(1)], ("-x",), "1 failed"),
        ([CRASHES_ONCE], ("--max-worker-restart=0",), "1 failed"),
    ],
    ids=["always fails", "one of two fails twice", "four that fail once", "strict", "stops at the first", "crash"],
)
def test_the_run_fails(tmp_path, tests, options, counts):
    done = run_suite(tmp_path, *tests, options=options)
    assert done.returncode != 0, done.stdout
    assert counts in closing_line(done), done.stdout
