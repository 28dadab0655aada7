"""Plugin for pytest: a few failed tests are run again, each by itself; those that then pass are reported as flaky."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest

MAX_SECOND_TRIES = 3
"""Number of failed tests that are run again; when more fail, none is."""


def pytest_configure(config: pytest.Config) -> None:
    """Watches runs whose failures may be run again: all but those of workers, of a debugger or with `--strict`."""
    option = config.option  # `--strict` is an older name of `--strict-markers`, which is always on here
    if not (option.strict or option.maxfail or option.usepdb or hasattr(config, "workerinput")):
        config.pluginmanager.register(SecondTry(config))


class SecondTry:
    """Runs failed tests again after all others, and decides whether the run has passed."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._failures: dict[str, list[Any]] = {}
        self._second: dict[str, subprocess.CompletedProcess[str]] = {}
        self._has_lost_worker = False

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, error: object) -> None:
        """Notes that a worker has crashed: its other tests may not have run."""
        self._has_lost_worker |= error is not None

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Collects the failed phases of each test."""
        if report.failed:
            self._failures.setdefault(report.nodeid, []).append(report)

    @pytest.hookimpl(trylast=True)  # the workers have ended by then
    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        """Runs the failed tests again, if they are few; the run passes if all of them do."""
        if exitstatus != pytest.ExitCode.TESTS_FAILED or self._has_lost_worker:
            return
        if len(self._failures) > MAX_SECOND_TRIES:
            return
        self._second = {name: self._run_alone(name) for name in self._failures}
        if self._second and not any(done.returncode for done in self._second.values()):
            session.exitstatus = pytest.ExitCode.OK

    @pytest.hookimpl(hookwrapper=True, tryfirst=True)  # before pytest prints the failures
    def pytest_terminal_summary(self, terminalreporter: Any) -> Any:
        """Counts flaky tests as such, and prints both outputs of all tests that ran twice."""
        stats = terminalreporter.stats
        flaky = [name for name, done in self._second.items() if done.returncode == 0]
        for outcome in ("failed", "error"):
            remaining = [report for report in stats.pop(outcome, ()) if report.nodeid not in flaky]
            if remaining:
                stats[outcome] = remaining
        if flaky:
            stats["flaky"] = [self._failures[name][0] for name in flaky]
        yield
        for name, done in self._second.items():
            passed = done.returncode == 0
            terminalreporter.section(f"flaky: {name}" if passed else f"failed twice: {name}")
            for report in self._failures[name] if passed else ():  # the others are among the failures
                terminalreporter.write_line(f"First run, {report.when}:")
                terminalreporter.write_line(report.longreprtext)
                for title, text in report.sections:
                    terminalreporter.write_sep("-", title)
                    terminalreporter.write_line(text)
            terminalreporter.write_line("Second run, by itself:")
            terminalreporter.write_line(done.stdout)
        if flaky:
            terminalreporter.write_line(f"{len(flaky)} flaky: enter in tests/flaky.md with its cause, and mend it")

    def _run_alone(self, name: str) -> subprocess.CompletedProcess[str]:
        """Runs one test in a process of its own, and returns its output and exit code."""
        where = ["-c", str(self._config.inipath), "--rootdir", str(self._config.rootpath)]
        alone = ["-n0", "--strict", "-rP", "-p", "no:run_report", name]
        if self._config.getoption("all", False):
            alone.append("--all")  # else a thorough test would be left out
        command = [sys.executable, "-m", "pytest", *where, *alone]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "stdin": subprocess.DEVNULL}
        return subprocess.run(command, cwd=self._config.rootpath, text=True, errors="replace", **pipes)
