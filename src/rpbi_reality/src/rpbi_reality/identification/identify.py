"""Identifies parameters of a world from measured motion, and writes the results."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from custom_ros_tools.config import load_config
from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.files import atomic_file
from rpbi.gym.randomization import DynamicsVariation

from ..pose_errors import Interval, bootstrap
from .candidate import WorldTemplate
from .evaluator import Evaluation, Evaluator
from .fit_config import FitConfig
from .parameter_space import ParameterSpace
from .pictures import parameter_picture
from .recording_files import read_recordings
from .search import search
from .uncertainty import Uncertainty, uncertainty

DIGITS = 6


class Identified(NamedTuple):
    """Result of an identification.

    Attributes:
        values: Identified values, indexed by parameter.
        uncertainty: Intervals, profiles and groups of parameters.
        before: Error of the held-out runs with the first values.
        after: Error of the held-out runs with the identified values.
        trained: Names of the runs from which the parameters were identified.
        held_out: Names of all other runs.
        candidates: Number of simulated candidates.
        problems: Why candidates could not be simulated, with the number of such candidates.
        template: The world, for the main file with the identified values.
    """

    values: Mapping[str, float]
    uncertainty: Uncertainty
    before: Interval
    after: Interval
    trained: list[str]
    held_out: list[str]
    candidates: int
    problems: Mapping[str, int]
    template: WorldTemplate


def read_fit(path: Path) -> FitConfig:
    """Reads the file that says what is identified.

    Raises:
        ConfigError: If the file is invalid.
    """
    return FitConfig.parse(load_config(str(path)), str(path))


def chosen_runs(config: FitConfig, names: list[str], file: str) -> tuple[list[int], list[int]]:
    """Returns the indices of the runs from which parameters are identified, and of the held-out runs.

    Raises:
        ConfigError: If a named run is missing, or there are fewer runs than `count`.
    """
    if config.runs.names:
        if missing := [name for name in config.runs.names if name not in names]:
            raise ConfigError([Problem(file, "runs.names", f"there is no run {', '.join(missing)}")])
        trained = [index for index, name in enumerate(names) if name in config.runs.names]
    else:
        count = config.runs.count or max(1, math.ceil(0.75 * len(names)))
        if count > len(names):
            raise ConfigError(
                [Problem(file, "runs.count", f"expected at most {len(names)}, the number of runs; got {count}")]
            )
        if config.runs.seed is None:
            chosen = [index * len(names) // count for index in range(count)]
        else:
            chosen = np.random.default_rng(config.runs.seed).permutation(len(names))[:count].tolist()
        trained = sorted(chosen)
    return trained, [index for index in range(len(names)) if index not in set(trained)]


def identify_world(
    world: str,
    data: Path,
    config: FitConfig,
    jobs: int,
    urdf: str | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> Identified:
    """Identifies parameters of a world.

    Args:
        world: Main file of the world.
        data: Measured motion.
        config: Parameters, signals and method.
        jobs: Number of processes; the result does not depend on it.
        urdf: URDF to load where a file names `robot_description`.
        report: Function that shows a line of progress.

    Raises:
        ConfigError: If a file is invalid.
        InterfaceError: If nothing depends on a parameter, or no candidate can be simulated.
        MissingDependency: If the search needs a library that is not installed.
    """
    runs = read_recordings(data, config)
    trained, held_out = chosen_runs(config, [run.name for run in runs], str(data))
    evaluator = Evaluator(world, config, runs, urdf, jobs)
    space = ParameterSpace(config.parameters)
    first = {name: each.first for name, each in config.parameters.items()}
    with evaluator.running() as evaluate:
        found = search(config, evaluate, trained, report)
        values = {name: float(f"{value:.{DIGITS}g}") for name, value in space.values(found.unit).items()}
        judged = held_out or trained
        before, after = evaluate([first, values], judged)
    return Identified(
        values,
        uncertainty(config, found),
        _error(config, before),
        _error(config, after),
        [runs[index].name for index in trained],
        [runs[index].name for index in held_out],
        evaluator.count,
        evaluator.problems,
        WorldTemplate(world, config, urdf),
    )


def _error(config: FitConfig, evaluation: Evaluation) -> Interval:
    errors = evaluation.runs if config.objective == "mean_error" else np.sqrt(evaluation.runs)
    return bootstrap(errors)


def randomization(config: FitConfig, found: Uncertainty) -> dict[str, Any]:
    """Returns a configuration for `rpbi.gym` that draws identified dynamics from their intervals."""
    known = DynamicsVariation.model_fields.keys() - {"object", "mass_factor"}
    by_object: dict[str, dict[str, Any]] = {}
    for name, parameter in config.parameters.items():
        for text in parameter.set:
            parts = text.split(".")
            if parts[0] in ("world", "measured", "inputs"):
                continue
            target, key = (".".join(parts[1:-1]), parts[-1]) if parts[0] == "dynamics" else (parts[0], parts[-1])
            key = "mass" if key == "baseMass" else key
            if key in known and (parts[0] == "dynamics" or key == "mass" or parts[1] == "changeDynamics"):
                by_object.setdefault(target, {})[key] = [float(f"{x:.{DIGITS}g}") for x in found.intervals[name]]
    delays = [
        found.intervals[name]
        for name, parameter in config.parameters.items()
        if any(text.startswith("inputs.") for text in parameter.set)
    ]
    content: dict[str, Any] = {"dynamics": [{"object": name, **ranges} for name, ranges in by_object.items()]}
    if delays:
        content["delays"] = {"action_s": [max(0.0, float(f"{x:.{DIGITS}g}")) for x in delays[0]]}
    return content


def write_results(folder: Path, world: str, config: FitConfig, result: Identified) -> list[Path]:
    """Writes the patched world, the results, the randomization, and pictures; all files or none.

    Args:
        folder: The folder, which is created.
        world: Main file of the world, for a comment.
        config: Parameters and signals.
        result: The result.

    Returns:
        The written files.
    """

    def rounded(number: float) -> float:
        return float(f"{number:.{DIGITS}g}")

    parameters = {
        name: {
            "value": value,
            "interval": [rounded(each) for each in result.uncertainty.intervals[name]],
            "set": list(config.parameters[name].set),
        }
        for name, value in result.values.items()
    }
    report = {
        "parameters": parameters,
        "held_out_error": {
            "before": [rounded(each) for each in result.before],
            "after": [rounded(each) for each in result.after],
        },
        "cannot_be_told_apart": [list(group) for group in result.uncertainty.alike],
        "profiles": {
            name: [[rounded(each) for each in pair] for pair in rows]
            for name, rows in result.uncertainty.profiles.items()
        },
        "identified_from": result.trained,
        "held_out": result.held_out,
        "candidates": result.candidates,
        "problems": dict(result.problems),
    }
    others = {name: value for name, value in result.values.items() if _is_no_key(config, name)}
    note = "".join(f"# {text}: {value:g}\n" for name, value in others.items() for text in config.parameters[name].set)
    head = f"# {Path(world).name} with identified values; see report.json for their intervals.\n{note}"
    texts = {
        "world.yaml": head
        + yaml.safe_dump(_plain(result.template.standalone_patch(result.values, folder)), sort_keys=False, width=120),
        "randomization.yaml": yaml.safe_dump(randomization(config, result.uncertainty), sort_keys=False),
        "report.json": json.dumps(report, indent=1) + "\n",
    }
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, text in texts.items():
        with atomic_file(folder / name) as part:
            part.write_text(text, encoding="utf-8")
        written.append(folder / name)
    with atomic_file(folder / "parameters.png") as part:
        parameter_picture(config, result.values, result.uncertainty).savefig(part, dpi=100, metadata={"Software": None})
    return [*written, folder / "parameters.png"]


def _is_no_key(config: FitConfig, name: str) -> bool:
    return any(text.split(".")[0] in ("measured", "inputs", "dynamics") for text in config.parameters[name].set)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    return value


def summary(result: Identified) -> str:
    """Returns the results as text."""
    width = max(map(len, result.values))
    lines = []
    for name, value in result.values.items():
        low, high = result.uncertainty.intervals[name]
        lines.append(f"{name:<{width}}  {value:<12.6g} [{low:.6g}, {high:.6g}]")
    lines.append(f"error of {len(result.held_out)} held-out runs: {result.before} before, {result.after} after")
    for group in result.uncertainty.alike:
        kind = "the data do not tell" if len(group) == 1 else "the data cannot tell apart"
        lines.append(f"{kind}: {', '.join(group)}")
    lines += [f"{count} candidates: {problem}" for problem, count in result.problems.items()]
    return "\n".join(lines)
