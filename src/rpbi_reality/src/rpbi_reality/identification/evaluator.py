"""Evaluates candidates in several processes, with results that do not depend on the number of processes."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import NamedTuple, Protocol

import numpy as np

from custom_ros_tools.errors import ConfigError, InterfaceError

from .candidate import CandidateWorld, WorldTemplate, mean_error, residuals
from .fit_config import FitConfig
from .recordings import MeasuredRun

DIVERGED = 1e3
"""Error of a run whose simulation diverges, as a multiple of the standard deviations."""
BATCH = 60
"""Number of runs that a process simulates for one candidate at a time."""


class Evaluation(NamedTuple):
    """Errors of one candidate.

    Attributes:
        runs: Error of each run, shape (runs,).
        residuals: Residuals of each run, flat arrays of equal length for all candidates; empty for `mean_error`.
        problems: Why runs could not be simulated.
    """

    runs: np.ndarray
    residuals: list[np.ndarray]
    problems: tuple[str, ...] = ()


class Evaluates(Protocol):
    """Evaluates candidates, in any simulator; see `Evaluator` for the members."""

    count: int
    simulated: int
    problems: dict[str, int]

    def __call__(self, candidates: Sequence[Mapping[str, float]], runs: Sequence[int]) -> list[Evaluation]: ...


class _Job(NamedTuple):
    """All that a process needs: world, parameters and measured runs."""

    path: str
    config: FitConfig
    robot_description: str | None
    runs: list[MeasuredRun]


_job: _Job | None = None
_template: WorldTemplate | None = None


def _start(job: _Job) -> None:
    global _job, _template
    _job, _template = job, WorldTemplate(job.path, job.config, job.robot_description)


def _evaluate(task: tuple[Mapping[str, float], Sequence[int]]) -> Evaluation:
    assert _job is not None and _template is not None
    return _of_runs(_template, task[0], [_job.runs[index] for index in task[1]])


def _of_runs(template: WorldTemplate, values: Mapping[str, float], runs: Sequence[MeasuredRun]) -> Evaluation:
    config, problems = template.config, []
    try:
        world = CandidateWorld(template, values)
    except (ConfigError, ValueError, InterfaceError) as error:
        return Evaluation(np.full(len(runs), DIVERGED), [_far(config, run) for run in runs], (str(error),))
    errors, rows = [], []
    try:
        for run in runs:
            try:
                cost, row = _of_run(config, world, run)
            except (InterfaceError, ValueError) as failure:
                problems.append(f"run {run.name}: {failure}")
                cost, row = DIVERGED, _far(config, run)
            errors.append(cost)
            rows.append(row)
    finally:
        world.close()
    return Evaluation(np.array(errors), rows, tuple(dict.fromkeys(problems)))


def _of_run(config: FitConfig, world: CandidateWorld, run: MeasuredRun) -> tuple[float, np.ndarray]:
    end_s = min(run.end_s, config.end_s or run.end_s)
    simulated = world.simulate(run, end_s).signals
    tracks = {signal: run.poses.get(signal) or run.joints.get(signal) for signal in config.measured}
    if config.objective == "mean_error":
        each = [mean_error(config.measured[s], track, simulated[s]) for s, track in tracks.items() if track is not None]
        error = float(np.sum(each))
        return (error if np.isfinite(error) else DIVERGED), np.zeros(0)
    rows = [residuals(config.measured[s], track, simulated[s]) for s, track in tracks.items() if track is not None]
    scaled = np.concatenate([each.ravel() / np.sqrt(each.size) for each in rows])
    scaled = np.nan_to_num(scaled, nan=DIVERGED, posinf=DIVERGED, neginf=-DIVERGED)
    return float((scaled**2).sum()), scaled


def _far(config: FitConfig, run: MeasuredRun) -> np.ndarray:
    """Returns residuals of a run that could not be simulated."""
    if config.objective == "mean_error":
        return np.zeros(0)
    end_s, sizes = min(run.end_s, config.end_s or run.end_s), []
    for signal in config.measured:
        track = run.poses.get(signal) or run.joints.get(signal)
        assert track is not None
        columns = 6 if signal in run.poses else track.position.shape[1]
        sizes.append(int((track.time <= end_s + 1e-9).sum()) * columns)
    return np.concatenate([np.full(size, DIVERGED / np.sqrt(size)) for size in sizes])


class Evaluator:
    """Evaluates candidates on measured runs.

    Args:
        path: Main file of the world.
        config: Parameters and signals.
        runs: All runs, from which parameters are identified, or which are held out.
        robot_description: URDF to load where a file names `robot_description`.
        jobs: Number of processes.
    """

    def __init__(
        self, path: str, config: FitConfig, runs: list[MeasuredRun], robot_description: str | None, jobs: int
    ) -> None:
        self._job = _Job(path, config, robot_description, runs)
        self._jobs = jobs
        self._pool: ProcessPoolExecutor | None = None
        self.count = 0
        """Number of evaluated candidates."""
        self.simulated = 0
        """Number of simulated runs, over all candidates."""
        self.problems: dict[str, int] = {}
        """Why candidates could not be simulated, with the number of such candidates."""

    @contextmanager
    def running(self) -> Iterator[Evaluator]:
        """Runs the processes during a context."""
        _start(self._job)
        if self._jobs > 1:
            context = multiprocessing.get_context("fork")
            self._pool = ProcessPoolExecutor(self._jobs, context, _start, (self._job,))
        try:
            yield self
        finally:
            if self._pool is not None:
                self._pool.shutdown(cancel_futures=True)
                self._pool = None

    def __call__(self, candidates: Sequence[Mapping[str, float]], runs: Sequence[int]) -> list[Evaluation]:
        """Evaluates candidates.

        Args:
            candidates: Values of all parameters, for each candidate.
            runs: Indices of the runs.
        """
        parts = [runs[begin : begin + BATCH] for begin in range(0, len(runs), BATCH)]
        tasks = [(values, part) for values in candidates for part in parts]
        done = list(map(_evaluate, tasks) if self._pool is None else self._pool.map(_evaluate, tasks))
        self.count += len(candidates)
        self.simulated += len(candidates) * len(runs)
        found = []
        for index in range(len(candidates)):
            mine = done[index * len(parts) : (index + 1) * len(parts)]
            problems = tuple(dict.fromkeys(problem for each in mine for problem in each.problems))
            for problem in problems[:1]:
                self.problems[problem] = self.problems.get(problem, 0) + 1
            found.append(
                Evaluation(
                    np.concatenate([each.runs for each in mine]),
                    [row for each in mine for row in each.residuals],
                    problems,
                )
            )
        return found
