"""The wheel: its modules, its ranges of versions, and its use in a Python that has no ROS."""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import tomllib
from packaging.requirements import Requirement
from PIL import Image

from custom_ros_tools.console import wheel as command
from custom_ros_tools.console.command import Command
from custom_ros_tools.console.release import version

ROOT = Path(__file__).resolve().parents[1]
SETTINGS = tomllib.loads((ROOT / "dev/wheel/pyproject.toml").read_text())
PROJECT = SETTINGS["project"]
PACKAGES = SETTINGS["tool"]["hatch"]["build"]["targets"]["wheel"]["hooks"]["custom"]["packages"]
REQUIREMENTS = [ROOT / "requirements/base.txt", *sorted(ROOT.glob("requirements/extras/*.txt"))]
WHEEL = ROOT / f"out/rpbi-{version(ROOT)}-py3-none-any.whl"
OF_EXTRAS = {
    "pinocchio",
    "hppfcl",
    "hpp-fcl",
    "daqp",
    "casadi",
    "pytracik",
    "viser",
    "msgspec",
    "trimesh",
    "fast_simplification",
}
OF_DEBIAN = {"PyKDL", "pytest"}
LACKING = OF_EXTRAS | OF_DEBIAN
"""Libraries that `installed` lacks: of other extras, and those of Debian that are for some solvers and for tests."""
MAX_FIRST_PICTURE_S = 120.0
"""Longest time from `pip install` to the first picture [s]."""


def wheel_ranges() -> dict[str, Requirement]:
    """Returns the requirements of the wheel and of its extras, by lower-case name."""
    optional = PROJECT["optional-dependencies"].values()
    lines = [*PROJECT["dependencies"], *(line for extra in optional for line in extra)]
    return {each.name.lower(): each for each in map(Requirement, lines)}


def outside(ranges: dict[str, Requirement], pins: str) -> list[str]:
    """Returns the pinned versions in a text of requirements that are outside of some ranges."""
    found = re.findall(r"^\s*([\w.-]+)==([\w.]+)", pins, re.MULTILINE)
    return [f"{name} {pin}" for name, pin in found if (each := ranges.get(name.lower())) and pin not in each.specifier]


def test_versions_that_tests_use_are_inside_of_the_ranges():
    assert [each for path in REQUIREMENTS for each in outside(wheel_ranges(), path.read_text())] == []


def test_version_outside_of_a_range_is_named():
    pins = "  pybullet==2.0.0\npydantic==99.0 # newer\nruff==1.0"
    assert outside(wheel_ranges(), pins) == ["pybullet 2.0.0", "pydantic 99.0"]


def test_extras_that_messages_name_exist():
    texts = [path.read_text() for package in PACKAGES for path in ROOT.glob(f"src/{package}/src/**/*.py")]
    named = {name for text in texts for name in re.findall(r'MissingDependency\(.*"\./rpbi setup (\w+)"', text)}
    assert named - {"farm"} == PROJECT["optional-dependencies"].keys()  # farms need ROS


def test_missing_extra_is_named_as_pip_takes_it(monkeypatch):
    errors = importlib.import_module("custom_ros_tools.errors")
    missing = errors.MissingDependency("gymnasium", "./rpbi setup gym")
    assert str(missing) == "'gymnasium' is not installed: ./rpbi setup gym"
    monkeypatch.setattr(errors, "IS_WHEEL", True)
    assert str(missing) == "'gymnasium' is not installed: pip install 'rpbi[gym]'"


@pytest.mark.parametrize(
    ("python", "is_refused"), [((3, 9), True), ((3, 10), False), ((3, 11), False), ((3, 12), True)]
)
def test_other_versions_of_python_are_refused(python, is_refused):
    script = f"import sys; sys.version_info = {python}; import rpbi"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300.0)
    message = f"rpbi needs CPython 3.10 or 3.11 on Linux, and this is Python {python[0]}.{python[1]} on linux"
    assert (message in done.stderr) == is_refused, done.stderr


@pytest.fixture(scope="module")
def selection() -> Any:
    """The module that selects the files of the wheel."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "dev/wheel"))
        return importlib.import_module("hatch_build")


@pytest.fixture(scope="module")
def modules(selection) -> dict[str, str]:
    """The path in the wheel of each module."""
    return selection.modules(ROOT / "src", PACKAGES)


def test_modules_that_need_ros_or_other_packages_are_left_out(selection, tmp_path):
    texts = {
        "ours/src/ours/free.py": "import numpy",
        "ours/src/ours/node.py": "import rospy",
        "ours/src/ours/late.py": "def late():\n    import ours.node",
        "ours/src/ours/console/list.py": "",
        "ours/src/ours/more.py": "import theirs",
        "theirs/src/theirs/__init__.py": "",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert list(selection.modules(tmp_path, ["ours"]).values()) == ["ours/free.py"]


def test_wheel_has_the_world_of_the_page_and_its_robot(selection, modules):
    files = {*modules.values(), *selection.shared_files(ROOT / "src", PACKAGES).values()}
    share = "custom_ros_tools/share/rpbi_examples"
    assert {f"{share}/package.xml", f"{share}/robots/kuka_lwr.urdf", "rpbi/world/world.py", "rpbi/gym/env.py"} <= files
    assert not [name for name in files if "/ros/" in name or "/console/" in name or name.endswith(".launch")]


def too_new(paths: list[str]) -> str:
    """Returns the lines of files that need a later Python than the oldest of the wheel."""
    pytest.importorskip("vermin", reason="the extra `wheel` is not installed")
    oldest = re.match(r">=([\d.]+)", PROJECT["requires-python"])[1]
    options = (f"--target={oldest}-", "--violations", "--eval-annotations", "--backport", "typing_extensions")
    done = subprocess.run(
        [sys.executable, "-c", "import vermin; vermin.main()", *options, *paths], capture_output=True, text=True
    )
    return done.stdout if done.returncode else ""


def test_oldest_python_runs_the_modules(modules):
    assert too_new(list(modules)) == ""


def test_later_features_of_python_are_found(tmp_path):
    path = tmp_path / "new.py"
    path.write_text("from enum import StrEnum\n")
    assert "StrEnum" in too_new([str(path)])


def test_failed_build_ends_with_the_reason(monkeypatch, tmp_path, capsys):
    (tmp_path / "dev/wheel").mkdir(parents=True)
    (tmp_path / "dev/wheel/pyproject.toml").write_text("[project]\nname = 'rpbi'\n")
    monkeypatch.setattr(command, "workspace", lambda: tmp_path)
    assert Command(command.wheel).run([]) == 1
    assert "wheel: hatchling: " in capsys.readouterr().err
    assert Command(command.wheel).run(["--help"]) == 0


def in_venv(folder: Path, *words: str | Path) -> str:
    """Runs a program of a venv in its folder, without anything of ROS; returns its standard output."""
    of_ros = re.compile(r"ROS_|RPBI_|PYTHON|CMAKE_PREFIX_PATH|VIRTUAL_ENV")
    environment = {name: value for name, value in os.environ.items() if not of_ros.match(name)}
    program = [str(folder / "venv/bin" / words[0]), *map(str, words[1:])]
    done = subprocess.run(program, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def first_picture(folder: Path, python: str) -> float:
    """Installs the wheel into a fresh venv and runs the first script of docs/python.md.

    Returns:
        The time from `pip install` to the picture [s].
    """
    subprocess.run([python, "-m", "venv", str(folder / "venv")], check=True)
    script = re.search(r"```python\n(.*?)```", (ROOT / "docs/python.md").read_text(), re.DOTALL)[1]
    (folder / "first.py").write_text(script)
    start_s = time.monotonic()
    in_venv(folder, "pip", "install", "--quiet", "--disable-pip-version-check", WHEEL)
    in_venv(folder, "python", "first.py")
    return time.monotonic() - start_s


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, float]:
    """A folder with a venv that has the wheel of `./rpbi wheel`, and the time to the first picture [s]."""
    importlib.import_module("hatchling")
    subprocess.run([ROOT / "rpbi", "wheel"], check=True)
    folder = tmp_path_factory.mktemp("wheel")
    took_s = first_picture(folder, "/usr/bin/python3")
    in_venv(folder, "pip", "install", "--quiet", f"{WHEEL}[gym,data]", "nbclient", "ipykernel")
    return folder, took_s


@pytest.mark.thorough
class TestInstalledWheel:
    def test_picture_comes_in_two_minutes(self, installed):
        folder, took_s = installed
        with Image.open(folder / "first.png") as picture:
            assert picture.size == (640, 480) and len(picture.getcolors(100_000)) > 100
        assert took_s < MAX_FIRST_PICTURE_S

    def test_picture_comes_with_the_oldest_python(self, installed, tmp_path):
        oldest = shutil.which("python3.10")
        if oldest is None or subprocess.run([oldest, "--version"]).returncode:
            pytest.skip("python3.10 is not installed")
        first_picture(tmp_path, oldest)
        assert (tmp_path / "first.png").stat().st_size > 1000

    def test_no_module_needs_ros(self, installed):
        script = """
import importlib, importlib.metadata, json
names = [str(path)[:-3].replace("/", ".") for path in importlib.metadata.files("rpbi") if path.suffix == ".py"]
missing = {}
for name in names:
    try:
        if not name.endswith("__main__"):
            importlib.import_module(name.removesuffix(".__init__"))
    except Exception as error:
        missing[name] = getattr(error, "package", None) or getattr(error, "name", None) or repr(error)
print(json.dumps([len(names), missing]))
"""
        count, missing = json.loads(in_venv(installed[0], "python", "-c", script).splitlines()[-1])
        assert count > 250
        assert {name: module for name, module in missing.items() if module not in LACKING} == {}

    def test_environment_of_gymnasium_runs(self, installed):
        script = "import gymnasium, rpbi_examples.gym as g; print(gymnasium.make('rpbi/Push-v0').reset(seed=1)[1])"
        assert "is_success" in in_venv(installed[0], "python", "-c", script)

    @pytest.mark.parametrize(
        ("name", "cell", "shown"),
        [
            ("notebook", "swing", "200"),
            ("notebook_episode", "run-again", "(True, True)"),
            ("notebook_episode", "run-otherwise", "False"),
        ],
    )
    def test_notebooks_run(self, installed, name, cell, shown):
        folder = installed[0]
        shutil.copy(ROOT / f"docs/{name}.ipynb", folder)
        if not (folder / f"{name}.done.ipynb").exists():
            in_venv(folder, "jupyter-execute", "--kernel_name=python3", f"{name}.ipynb", f"--output={name}.done.ipynb")
        cells = {each["id"]: each for each in json.loads((folder / f"{name}.done.ipynb").read_text())["cells"]}
        (result,) = (each["data"] for each in cells[cell]["outputs"] if each["output_type"] == "execute_result")
        assert "".join(result["text/plain"]) == shown
