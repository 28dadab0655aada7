"""Plugin for pytest: a run ends with where its time went."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import pytest

SLOWEST = 15
LAST_LINES = 30
Row = tuple[int, float, float]
"""Number of tests, wall time and processor time [s]."""
WALL, PROCESSOR = 1, 2


def pytest_configure(config: pytest.Config) -> None:
    """Has this run measured and reported."""
    config.pluginmanager.register(RunReport())


class RunReport:
    """Measures each phase of a test, and lists the times of folders, of the slowest files and tests at the end."""

    def __init__(self) -> None:
        self._used_s = processor_s()
        self._tests: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])

    def pytest_collection_finish(self) -> None:
        """Counts from here on."""
        self._used_s = processor_s()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_makereport(self, item: Any) -> Iterator[None]:
        """Adds the processor time of a phase [s] to its report, and after a failure the last lines of all programs.

        The processor time of a program counts when the program has ended.
        """
        outcome: Any = yield
        report = outcome.get_result()
        before, self._used_s = self._used_s, processor_s()
        report.processor_s = self._used_s - before
        if report.failed and report.when == "call":
            for system in (item.funcargs.get(name) for name in ("ros", "module_ros")):
                for process in () if system is None else system.processes:
                    lines = system.output(process).splitlines()[-LAST_LINES:]
                    report.sections.append((f"End of the output of {process.args}", "\n".join(lines)))

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Adds a phase up, in the process that reports."""
        times = self._tests[report.nodeid]
        times[0] += report.duration
        times[1] += getattr(report, "processor_s", 0.0)

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Prints the tables."""
        if not self._tests:
            return
        tests = {name: (1, times[0], times[1]) for name, times in self._tests.items()}
        files = _summed(tests, lambda name: name.split("::")[0])
        folders = _summed(files, os.path.dirname)
        tables = {
            "time by folder": [*sorted(folders.items()), *_summed(folders, lambda _: "all").items()],
            f"slowest {SLOWEST} files": _most(files, WALL),
            f"{SLOWEST} files with the most processor time": _most(files, PROCESSOR),
            f"slowest {SLOWEST} tests": _most(tests, WALL),
        }
        for title, rows in tables.items():
            terminalreporter.section(title)
            terminalreporter.write_line(f"{'tests':>6} {'seconds':>9} {'processor':>10}")
            for name, (count, wall_s, used_s) in rows:
                terminalreporter.write_line(f"{count:6} {wall_s:9.1f} {used_s:10.1f}  {name}")


def _summed(rows: Mapping[str, Row], group: Callable[[str], str]) -> dict[str, Row]:
    """Returns the sum of the rows of each group."""
    sums: defaultdict[str, Row] = defaultdict(lambda: (0, 0.0, 0.0))
    for name, row in rows.items():
        count, wall_s, used_s = sums[group(name)]
        sums[group(name)] = (count + row[0], wall_s + row[1], used_s + row[2])
    return sums


def _most(rows: Mapping[str, Row], column: int) -> list[tuple[str, Row]]:
    """Returns the rows with the largest numbers in a column, largest first."""
    return sorted(rows.items(), key=lambda item: -item[1][column])[:SLOWEST]


def processor_s() -> float:
    """Returns the processor time of this process and of its children that have ended [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
