"""Plugin for pytest: which tests run, on which worker, and in which order."""

from __future__ import annotations

import faulthandler
import fcntl
import os
import shutil
import tempfile
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).resolve().parents[2]
FIRST = (
    "test_lint.py",
    "ros/rpbi_examples",
    "ros/rpbi_data",
    "test_commands.py",
    "gui",
    "ros",
    "unit/safe_robot",
    "sim/rpbi/world",
    "sim/rpbi_examples",
    "sim",
)
"""Folders and files that take long: they are begun first, so that no worker is left alone with one at the end."""

QUICK_FOLDERS = ("unit", "sim")
"""Folders whose tests are quick, as those of the top are; elsewhere those with the mark."""
NOT_QUICK = (
    "sim/ik_ros/test_chain_solvers.py",
    "sim/rpbi/bodies/test_other_robots.py",
    "sim/rpbi/bodies/test_soft.py",
    "sim/rpbi/meshes/test_hostile_files.py",
    "sim/rpbi/pages",
    "sim/rpbi/reference",
    "sim/rpbi/render/test_render.py",
    "sim/rpbi/sensors/test_force_torque.py",
    "sim/rpbi/world/test_reset.py",
    "sim/rpbi/world/test_saved.py",
    "sim/rpbi/world/test_world_warnings.py",
    "sim/rpbi_examples",
    "sim/rpbi_mpc",
    "test_commands.py",
    "test_second_try.py",
    "unit/operator_node/test_spacenav.py",
    "unit/safe_robot/test_checks.py",
    "unit/safe_robot/test_guard_fuzz.py",
)
"""Folders and files whose tests take longest: of these, too, only tests with the mark are quick."""

EXTRA_OF = {
    "pinocchio": "ik",
    "daqp": "ik",
    "ompl": "planning",
    "casadi": "mpc",
    "cv2": "tags",
    "viser": "html",
    "foxglove": "foxglove",
    "trimesh": "html",
    "fast_simplification": "html",
    "msgspec": "html",
    "zstandard": "html",
    "gymnasium": "gym",
    "nbclient": "notebook",
    "nbformat": "notebook",
    "av": "data",
    "pyarrow": "data",
    "rosbags": "data",
    "cyclonedds": "ros2",
    "ray": "farm",
    "mujoco": "mujoco",
    "cmaes": "identify",
    "mkdocs": "site",
    "py_mini_racer": "site",
    "hatchling": "wheel",
    "vermin": "wheel",
}
"""Extra that has a module."""


STUCK_S = 700.0
"""After so long a test that its time-out cannot end, since it is stuck outside of Python, ends its worker [s]."""
STDERR = pytest.StashKey[int]()
"""Where the stacks of a stuck worker go."""


LOCKS = pytest.StashKey[Path]()
"""Folder of the locks that all workers of a run share."""


def pytest_configure(config: pytest.Config) -> None:
    """Keeps a way out to the terminal that no test captures, and the folder of the locks."""
    config.stash[STDERR] = os.dup(2)
    shared = getattr(config, "workerinput", {}).get("locks")
    config.stash[LOCKS] = Path(shared or tempfile.mkdtemp(prefix="rpbi-tests-"))


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Tells a worker the folder of the locks."""
    node.workerinput["locks"] = str(node.config.stash[LOCKS])


def pytest_unconfigure(config: pytest.Config) -> None:
    """Removes the folder of the locks after all workers have ended."""
    if not hasattr(config, "workerinput"):
        shutil.rmtree(config.stash[LOCKS], ignore_errors=True)


@pytest.hookimpl(hookwrapper=True, tryfirst=True)  # the time-out begins after the wait
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, None, None]:
    """Runs a test with the mark `alone` while no other worker runs one; has a stuck run end with where."""
    with _turn(item.config.stash[LOCKS], fcntl.LOCK_EX if item.get_closest_marker("alone") else fcntl.LOCK_SH):
        faulthandler.dump_traceback_later(STUCK_S, exit=True, file=item.config.stash[STDERR])
        yield
        faulthandler.cancel_dump_traceback_later()


@contextmanager
def _turn(folder: Path, kind: int) -> Iterator[None]:
    """Waits for a lock, behind all workers that wait already, and holds it during a `with` block."""
    with (folder / "queue").open("w") as queue, (folder / "run").open("w") as run:
        fcntl.flock(queue, fcntl.LOCK_EX)  # without it, tests that share the lock would keep an exclusive one waiting
        fcntl.flock(run, kind)
        fcntl.flock(queue, fcntl.LOCK_UN)
        yield


def pytest_addoption(parser: pytest.Parser) -> None:
    """Knows `--quick`, `--all` and `--skip-missing-extras`."""
    parser.addoption("--quick", action="store_true", help="most of unit and sim, one test of each ROS path")
    parser.addoption("--all", action="store_true", help="also tests with the mark `thorough`")
    text = "skip tests that need an extra that is not installed"
    parser.addoption("--skip-missing-extras", action="store_true", help=text)


def _missing_extra(error: BaseException | None) -> str | None:
    """Returns what an error and its causes say of an extra that is not installed."""
    while error is not None:
        if type(error).__name__ == "MissingDependency":
            return str(error)
        if isinstance(error, ModuleNotFoundError) and error.name in EXTRA_OF:
            return f"'{error.name}' is not installed: ./rpbi setup {EXTRA_OF[error.name]}"
        error = error.__cause__
    return None


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator[None, Any, None]:
    """Makes a file whose imports miss an extra a skipped one, if that is asked for."""
    report = (yield).get_result()
    missing = report.call.excinfo and _missing_extra(report.call.excinfo.value)
    if missing and collector.config.getoption("skip_missing_extras"):
        report.outcome, report.longrepr, report.result = "skipped", (str(collector.path), 1, f"Skipped: {missing}"), []


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo) -> Generator[None, Any, None]:
    """Makes a test that misses an extra a skipped one, if that is asked for."""
    report = (yield).get_result()
    missing = call.excinfo and _missing_extra(call.excinfo.value)
    if missing and item.config.getoption("skip_missing_extras"):
        report.outcome, report.longrepr = "skipped", (str(item.path), item.location[1], f"Skipped: {missing}")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leaves files without a quick test out of a quick run, since their imports take long."""
    is_file = collection_path.match("test_*.py") and collection_path.is_file()
    if config.getoption("quick") and is_file and not _is_all_quick(collection_path):
        return True if "pytest.mark.quick" not in collection_path.read_text() else None
    return None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leaves out what is not asked for and brings the folders into their order; within, everything stays as it is."""
    chosen = [item for item in items if _is_chosen(item)]
    config.hook.pytest_deselected(items=[item for item in items if not _is_chosen(item)])
    items[:] = chosen

    def rank(item: pytest.Item) -> int:
        matches = (number for number, folder in enumerate(FIRST) if item.path.is_relative_to(TESTS / folder))
        return next(matches, len(FIRST))

    items.sort(key=rank)


def _is_chosen(item: pytest.Item) -> bool:
    option = item.config.getoption
    if item.get_closest_marker("thorough") and not option("all"):
        return False
    return _is_quick(item) or not option("quick")


def _is_quick(item: pytest.Item) -> bool:
    return _is_all_quick(item.path) or item.get_closest_marker("quick") is not None


def _is_all_quick(path: Path) -> bool:
    if any(path.is_relative_to(TESTS / name) for name in NOT_QUICK):
        return False
    return path.parent == TESTS or any(path.is_relative_to(TESTS / folder) for folder in QUICK_FOLDERS)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Returns how many workers `-n auto` means: one more than processors, since tests wait for some of their time.

    With two more, nodes take turns so often that all of them need a fifth more of processor time.
    """
    files = [argument.split("::")[0] for argument in getattr(config, "args", ())]
    wanted = (os.cpu_count() or 1) + 1
    if all(Path(file).is_file() for file in files):
        wanted = min(wanted, len(set(files)))
    return wanted if wanted > 1 else 0


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Returns a scheduler that gives out whole files in their order, since the tests of a file share simulators."""
    from xdist.scheduler import LoadFileScheduling

    config.option.loadscopereorder = False
    return LoadFileScheduling(config, log)
