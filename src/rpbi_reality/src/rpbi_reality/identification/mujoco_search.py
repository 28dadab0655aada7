"""Identifies the cube of the tosses in MuJoCo, with the search of `./rpbi identify`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..tosses.mujoco_cube import MEASURED, MujocoCube, MujocoSettings
from ..tosses.toss_data import TossData
from ..tosses.toss_world import toss_errors
from .candidate import mean_error
from .evaluator import DIVERGED, Evaluation
from .fit_config import FitConfig
from .identify import chosen_runs, read_fit
from .parameter_space import ParameterSpace
from .recordings import PoseTrack
from .search import search
from .uncertainty import uncertainty


class MujocoFit(NamedTuple):
    """Result of the search.

    Attributes:
        values: Identified values, indexed by parameter.
        intervals: 95 % intervals, indexed by parameter.
        trained: Mean error of position in percent of the width, and of rotation [deg], of the tosses of the search.
        held_out: The same errors of all other tosses.
    """

    values: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]
    trained: tuple[float, float]
    held_out: tuple[float, float]


def settings(values: Mapping[str, float]) -> MujocoSettings:
    """Returns the settings of a candidate; see configs/tosses/fit_mujoco.yaml for the parameters."""
    plain = {name: value for name, value in values.items() if name in MujocoSettings._fields and name != "inertia"}
    moment = values["inertia"]
    return MEASURED._replace(**plain, centre=(0.0, 0.0, values["centre_z"]), inertia=(moment, moment, moment))


class MujocoEvaluator:
    """Evaluates candidates in MuJoCo, see `identification.evaluator.Evaluates`."""

    def __init__(self, config: FitConfig, data: TossData) -> None:
        self._signal, self._data = config.measured["cube"], data
        self.count = self.simulated = 0
        self.problems: dict[str, int] = {}

    def __call__(self, candidates: Sequence[Mapping[str, float]], runs: Sequence[int]) -> list[Evaluation]:
        """Returns the errors of each candidate in these tosses."""
        self.count += len(candidates)
        self.simulated += len(candidates) * len(runs)
        return [self._evaluate(MujocoCube(settings(values), self._data.frame_rate), runs) for values in candidates]

    def _evaluate(self, cube: MujocoCube, runs: Sequence[int]) -> Evaluation:
        errors = []
        for index in runs:
            toss = self._data.tosses[index]
            time = np.arange(len(toss.position)) / self._data.frame_rate
            simulated = np.hstack(cube(toss.start, len(time)))
            error = mean_error(self._signal, PoseTrack(time, toss.position, toss.quaternion), simulated)
            errors.append(error if np.isfinite(error) else DIVERGED)
        return Evaluation(np.array(errors), [np.zeros(0)] * len(runs))


def fit_mujoco(path: Path, fit: Path) -> MujocoFit:
    """Searches for the settings of MuJoCo with the smallest errors.

    Args:
        path: File of the tosses.
        fit: File with parameters and tosses of the search, such as configs/tosses/fit_mujoco.yaml.

    Raises:
        ConfigError: If a file is not of the expected form.
        MissingDependency: If MuJoCo or CMA-ES is not installed.
    """
    data, config = TossData.read(path), read_fit(fit)
    trained, held_out = chosen_runs(config, [toss.name for toss in data.tosses], str(path))
    found = search(config, MujocoEvaluator(config, data), trained)
    values = ParameterSpace(config.parameters).values(found.unit)
    cube = MujocoCube(settings(values), data.frame_rate)

    def mean(chosen: list[int]) -> tuple[float, float]:
        errors = toss_errors(cube, data, chosen)
        return float(errors.position.mean()), float(errors.rotation.mean())

    return MujocoFit(values, uncertainty(config, found).intervals, mean(trained), mean(held_out))
