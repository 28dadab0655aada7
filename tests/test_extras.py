"""The extras: what `./rpbi setup EXTRA` installs."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from ros_system import support_on_path

ROOT = Path(__file__).resolve().parent.parent
FILES = [ROOT / "requirements/base.txt", *sorted(ROOT.glob("requirements/extras/*.txt"))]


def pins(file: Path) -> dict[str, str]:
    """Returns what a file asks for, by package."""
    lines = [line.split("#")[0].strip() for line in file.read_text().splitlines()]
    return dict(re.fullmatch(r"([\w.-]+)(.*)", line).groups() for line in lines if line)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_packages_are_pinned(file):
    loose = {name: pin for name, pin in pins(file).items() if not re.fullmatch(r"==[\w.]+", pin)}
    assert loose in ({}, {"numpy": "<2"})


def test_extras_go_together():
    wanted: dict[str, str] = {}
    for file in FILES:
        for name, pin in pins(file).items():
            assert pin == "<2" or wanted.setdefault(name, pin) == pin, f"{file.name}: {name}"
    assert wanted["numpy"].startswith("==1."), "Debian's packages are built for NumPy 1"


def test_an_unknown_extra_is_refused_with_the_known_ones():
    answer = subprocess.run([str(ROOT / "rpbi"), "setup", "ikk"], capture_output=True, text=True, timeout=300.0)
    assert answer.returncode == 2
    known = "assets data farm foxglove gym html identify ik mpc mujoco notebook planning ros2 site tags wheel"
    assert f"There is no extra 'ikk'; there are: {known}." in answer.stderr


@pytest.mark.parametrize(
    ("arguments", "chosen"),
    [
        ("", False),
        ("--quick", False),
        ("--all", False),
        ("-k grasp", False),
        ("tests/unit", True),
        ("-x tests/test_lint.py::test_x", True),
    ],
)
def test_extras_are_wanted_unless_tests_are_chosen(arguments, chosen):
    script = (ROOT / "rpbi").read_text()
    function = script[script.index("names_tests()") : script.index("refuse_spaces()")]
    done = subprocess.run(["bash", "-c", f"{function}\nnames_tests {arguments}"], cwd=ROOT)
    assert (done.returncode == 0) == chosen


@pytest.mark.parametrize("lenient", [True, pytest.param(False, marks=pytest.mark.thorough)])
def test_chosen_tests_that_miss_an_extra_are_skipped_with_name(lenient):
    """Without the option, which `./rpbi test PATH` adds, they fail."""
    files = ["test_tasks.py", "test_tasks_solver.py", "test_trajectory_solver.py", "test_schemas.py"]
    options = ["-n", "0", "-p", "without_extras", *["--skip-missing-extras"] * lenient]
    command = [sys.executable, "-m", "pytest", *options, *(f"tests/unit/ik_ros/{file}" for file in files)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env={**os.environ, **support_on_path()})
    assert (done.returncode == 0) == lenient, done.stdout
    for extra in ("ik", "mpc") if lenient else ():
        assert re.search(rf"SKIPPED .* is not installed: ./rpbi setup {extra}\n", done.stdout), done.stdout


@pytest.mark.parametrize("wanted", [[], ["mpc"]], ids=["none", "mpc"])
def test_installed_requirements_are_known_with_and_without_extras(tmp_path, wanted):
    """Where the list of files ended with an error, set-up without extras failed at its last step."""
    script = (ROOT / "rpbi").read_text()
    functions = script[script.index("known_extras()") : script.index("# What Python files say")]
    if wanted:
        (tmp_path / "extras").write_text("\n".join(wanted) + "\n")
    command = f"set -o pipefail; root={ROOT}; state={tmp_path}\n{functions}\nvenv_inputs"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=300.0)
    assert done.returncode == 0, done.stderr
    files = [ROOT / "requirements/base.txt", *(ROOT / f"requirements/extras/{extra}.txt" for extra in wanted)]
    assert done.stdout == "".join(file.read_text() for file in files)
