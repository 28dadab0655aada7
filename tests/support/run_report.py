"""Plugin for pytest: a run ends with where its time went."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import pytest

SLOWEST = 10


def pytest_configure(config: pytest.Config) -> None:
    """Has this run measured and reported."""
    config.pluginmanager.register(RunReport())


class RunReport:
    """Measures each phase of a test, and lists the times of folders and of the slowest tests at the end."""

    def __init__(self) -> None:
        self._used_s = processor_s()
        self._tests: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])

    def pytest_collection_finish(self) -> None:
        """Counts from here on."""
        self._used_s = processor_s()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_makereport(self) -> Iterator[None]:
        """Notes in a report how much processor time its phase took [s]; programs count when they have ended."""
        outcome: Any = yield
        before, self._used_s = self._used_s, processor_s()
        outcome.get_result().processor_s = self._used_s - before

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Adds a phase up, in the process that reports."""
        times = self._tests[report.nodeid]
        times[0] += report.duration
        times[1] += getattr(report, "processor_s", 0.0)

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        """Lists what there is to tell."""
        if not self._tests:
            return
        folders: dict[str, list[float]] = defaultdict(lambda: [0, 0.0, 0.0])
        for name, times in self._tests.items():
            row = folders[os.path.dirname(name.split("::")[0])]
            for column, value in enumerate((1, *times)):
                row[column] += value
        folders["all"] = [sum(column) for column in zip(*folders.values())]
        write = terminalreporter.write_line
        terminalreporter.section("time by folder")
        write(f"{'tests':>6} {'seconds':>9} {'processor':>10}  folder")
        for folder, (count, wall_s, used_s) in sorted(folders.items(), key=lambda item: (item[0] == "all", item[0])):
            write(f"{count:6} {wall_s:9.1f} {used_s:10.1f}  {folder}")
        terminalreporter.section(f"slowest {SLOWEST}")
        for name, (wall_s, used_s) in sorted(self._tests.items(), key=lambda item: -item[1][0])[:SLOWEST]:
            write(f"{'':6} {wall_s:9.1f} {used_s:10.1f}  {name}")


def processor_s() -> float:
    """Returns the processor time of this process and of its children that have ended [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
