"""Simulates the published experiments with several settings and engines, and compares them with the measurements."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from custom_ros_tools.config import replace_package
from custom_ros_tools.errors import ConfigError, InterfaceError, MissingDependency, Problem
from rpbi.world.loading import load_world

from .pose_errors import Interval, bootstrap
from .pushes.push_data import PushErrors, PushPoses, PushRun, errors_against, read_runs, spread
from .pushes.push_world import simulate_pushes
from .tosses.toss_data import TossData
from .tosses.toss_world import TossErrors, TossWorld, toss_errors

CONFIGS = "{rpbi_reality}/configs"
TOSS_WORLDS = {
    "PyBullet, preset `impact`": "tosses/world.yaml",
    "PyBullet, published facts": "tosses/published.yaml",
    "PyBullet, measured lengths, gravity and centre of mass": "tosses/measured.yaml",
}
"""World of each row of the table of tosses; the first row has pictures."""
PUSH_WORLDS = {
    "PyBullet, identified": "pushes/identified_{}.yaml",
    "PyBullet, published facts": "pushes/experiment_{}.yaml",
}
"""Worlds of each row of the table of pushes, with a place for the experiment's number; the first row has pictures."""
REALITY = "real runs, each against the others"
DIVERGED = 1e4
"""Error [mm or deg] from which a simulation counts as diverged."""


class Row(NamedTuple):
    """A row of a table: name, and intervals or a text for each column."""

    name: str
    cells: dict[str, Interval | str]


class TossResult(NamedTuple):
    """Results of the tosses: rows of the table, and errors and motions of the first row, for pictures."""

    data: TossData
    rows: list[Row]
    errors: TossErrors
    simulated: Callable[[int], tuple[np.ndarray, np.ndarray]]


class PushResult(NamedTuple):
    """Results of an experiment of the arm: rows of the table, measured runs, and poses of the first row."""

    experiment: int
    rows: list[Row]
    runs: list[PushRun]
    poses: PushPoses | None


def find_file(folder: Path, stem: str) -> Path | None:
    """Returns the file STEM.npz of a folder, or the only file STEM_*.npz; None if there is no such file.

    Raises:
        ConfigError: If several files match.
    """
    if (exact := folder / f"{stem}.npz").is_file():
        return exact
    found = sorted(path for path in folder.glob(f"{stem}_*.npz") if not path.stem.endswith("_simulators"))
    if len(found) > 1:
        raise ConfigError(
            [Problem(str(folder), "", f"expected one file {stem}*.npz, got {', '.join(p.name for p in found)}")]
        )
    return found[0] if found else None


def find_urdf(folder: Path) -> Path | None:
    """Returns the URDF of the arm in a folder of data; None if it is missing."""
    places = (folder / "m1n6s300/m1n6s300.urdf", folder / "m1n6s300.urdf", folder / "urdf/m1n6s300.urdf")
    return next((place for place in places if place.is_file()), None)


def world_file(name: str) -> str:
    """Returns the path of a world of this package."""
    return replace_package(f"{CONFIGS}/{name}")


def evaluate_tosses(path: Path) -> TossResult:
    """Simulates all tosses of a file with each setting and engine.

    Raises:
        ConfigError: If the file is not of the expected form.
    """
    data = TossData.read(path)
    rows, first = [], None
    for name, file in TOSS_WORLDS.items():
        world = TossWorld(load_world(world_file(file)), data.frame_rate)
        try:
            errors = toss_errors(world, data)
        finally:
            world.close()
        first = errors if first is None else first
        rows.append(_toss_row(name, errors))
    try:
        from .tosses import mujoco_cube
    except MissingDependency as missing:
        rows.append(Row(f"MuJoCo: {missing}", {}))
    else:
        for name, settings in mujoco_cube.SETTINGS.items():
            rows.append(_toss_row(name, toss_errors(mujoco_cube.MujocoCube(settings, data.frame_rate), data)))
    assert first is not None

    def simulated(index: int) -> tuple[np.ndarray, np.ndarray]:
        world = TossWorld(load_world(world_file(next(iter(TOSS_WORLDS.values())))), data.frame_rate)
        try:
            return world(data.tosses[index].start, len(data.tosses[index].position))
        finally:
            world.close()

    return TossResult(data, rows, first, simulated)


def _toss_row(name: str, errors: TossErrors) -> Row:
    return Row(name, {key: bootstrap(each) for key, each in zip(TossErrors._fields, errors)})


def evaluate_pushes(path: Path, urdf: Path | None, simulators: Path | None) -> Iterator[PushResult]:
    """Simulates each experiment of the arm, and compares with the measured runs and with the study's simulators.

    Args:
        path: File of the measured runs.
        urdf: URDF of the arm; None: only reality's spread and the study's simulators are compared.
        simulators: File of the study's simulated runs; None without such a file.

    Raises:
        ConfigError: If a file is not of the expected form.
    """
    runs = read_runs(path)
    others = read_runs(simulators) if simulators is not None else []
    for experiment in sorted({run.experiment for run in runs}):
        measured = [run for run in runs if run.experiment == experiment]
        poses = [run.poses for run in measured]
        rows, first = [], None
        rows.append(_push_row(REALITY, spread(poses)) if len(poses) > 1 else Row(f"{REALITY}: only one run", {}))
        for name, file in PUSH_WORLDS.items() if urdf is not None else ():
            try:
                loaded = load_world(world_file(file.format(experiment)), str(urdf))
                simulated = simulate_pushes(loaded, experiment)
            except InterfaceError as error:
                rows.append(Row(f"{name}: {error}", {}))
                continue
            first = simulated if first is None else first
            rows.append(_push_row(name, errors_against(simulated, poses)))
        rows += [
            _push_row(f"the study's {other.name}", errors_against(other.poses, poses))
            for other in others
            if other.experiment == experiment
        ]
        yield PushResult(experiment, rows, measured, first)


def _push_row(name: str, errors: PushErrors) -> Row:
    cells: dict[str, Interval | str] = {}
    for key, each in zip(PushErrors._fields, errors):
        interval = bootstrap(each)
        cells[key] = interval if interval.mean < DIVERGED else "diverged"
    return Row(name, cells)


def as_numbers(row: Row) -> dict[str, Any]:
    """Returns the cells of a row for JSON: mean, low and high of each interval."""
    return {key: each._asdict() if isinstance(each, Interval) else each for key, each in row.cells.items()}
