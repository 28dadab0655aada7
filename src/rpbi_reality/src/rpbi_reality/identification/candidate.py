"""A world with the values of a candidate, and the motion that it simulates for measured runs."""

from __future__ import annotations

import copy
import math
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pybullet

from custom_ros_tools.config import replace_package
from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from robot_model.asset_files import find_file, find_folder
from robot_model.geometry import Pose
from rpbi.bodies.dynamic import DynamicObjectConfig
from rpbi.config.object_entry import parse_object_entry
from rpbi.config.pybullet_models import ResetBaseVelocity
from rpbi.world import World
from rpbi.world.file_kinds import load_main_file, load_object_file
from rpbi.world.loading import LoadedWorld, load_world, load_world_dict
from rpbi.world.objects import object_sections

from ..pose_errors import angle_deg, rotated
from .fit_config import FitConfig, SignalConfig
from .recordings import JointTrack, MeasuredRun, PoseTrack

_PART = re.compile(r"([A-Za-z0-9_]+)((?:\[\d+\])*)")


def _steps(path: str) -> list[str | int]:
    """Splits a path such as `a.b[2]` into keys and indices."""
    steps: list[str | int] = []
    for part in path.split("."):
        match = _PART.fullmatch(part)
        if match is None:
            raise ValueError(f"expected keys and [N], got '{path}'")
        steps.append(match[1])
        steps += [int(number) for number in re.findall(r"\d+", match[2])]
    return steps


def _put(data: Any, steps: Sequence[str | int], value: float) -> Any:
    """Returns a copy of nested mappings and lists, with one value replaced."""
    if not steps:
        return value
    first, rest = steps[0], steps[1:]
    if isinstance(first, int):
        items = list(data) if isinstance(data, (list, tuple)) else []
        if first >= 10:
            raise ValueError(f"[{first}]: expected a number below 10")
        items += [0.0] * (first + 1 - len(items))
        items[first] = _put(items[first], rest, value)
        return items
    mapping = dict(data) if isinstance(data, Mapping) else {}
    mapping[first] = _put(mapping.get(first), rest, value)
    return mapping


class WorldTemplate:
    """A world in YAML whose keys are replaced by the values of candidates.

    Args:
        path: Main file of the world.
        config: The parameters.
        robot_description: URDF to load where a file names `robot_description`; None without one.

    Raises:
        ConfigError: If the world is invalid, or a parameter names something that the world lacks.
    """

    def __init__(self, path: str, config: FitConfig, robot_description: str | None = None) -> None:
        self.path, self.config, self._urdf = replace_package(path), config, robot_description
        loaded = load_world(path, robot_description)
        self._main = dict(load_main_file(path))
        self._entries: dict[str, tuple[str, int]] = {}
        self._paths: dict[tuple[str, int], str] = {}
        self._files: dict[str, Mapping[str, Any]] = {}
        self._find_objects()
        problems = []
        for name, parameter in config.parameters.items():
            for text in parameter.set:
                place, _, rest = text.partition(".")
                key = f"parameters.{name}.set"
                if place == "inputs" and not rest.endswith(".delay_s"):
                    problems.append(Problem(path, key, f"expected inputs.SLOT.delay_s, got '{text}'"))
                elif place == "measured" and rest.split(".")[0] not in config.measured:
                    problems.append(Problem(path, key, f"there is no measured signal '{rest.split('.')[0]}'"))
                elif place not in ("world", "measured", "inputs", "dynamics") and place not in self._entries:
                    problems.append(Problem(path, key, str(UnknownNameError("object", place, self._entries))))
        for signal, measured in config.measured.items():
            for key, target in (("object", measured.object), ("frame", measured.frame)):
                name = (target or "").split("/")[0]
                if name and name not in {each.config.name for each in loaded.objects}:
                    message = str(UnknownNameError("object", name, [each.config.name for each in loaded.objects]))
                    problems.append(Problem(path, f"measured.{signal}.{key}", message))
        if problems:
            raise ConfigError(problems)

    def patch(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Returns the main file with the values of parameters, as a mapping that can be written as YAML."""
        main: dict[str, Any] = copy.deepcopy(self._main)
        for name, value in values.items():
            for text in self.config.parameters[name].set:
                place, _, rest = text.partition(".")
                if place in ("measured", "inputs", "dynamics"):
                    continue
                if place == "world":
                    main = _put(main, _steps(rest), value)
                    continue
                section, index = self._entries[place]
                entry = main[section][index]
                overrides = {"file": entry} if isinstance(entry, str) else dict(entry)
                steps = _steps(rest)
                if any(isinstance(step, int) for step in steps):  # lists are replaced as a whole
                    overrides = _with_list(overrides, self._files[place], steps)
                main[section][index] = _put(overrides, steps, value)
        return main

    def standalone_patch(self, values: Mapping[str, float], folder: Path) -> dict[str, Any]:
        """Returns the main file with the values of parameters, for a file in another folder.

        Args:
            values: Values of parameters.
            folder: Folder to which the names of the objects' files are relative.
        """
        main = self.patch(values)
        for (section, index), path in self._paths.items():
            entry = main[section][index]
            file = os.path.relpath(path, folder)
            main[section][index] = file if isinstance(entry, str) else {**entry, "file": file}
        return main

    def load(self, values: Mapping[str, float]) -> LoadedWorld:
        """Loads the world with the values of parameters.

        Raises:
            ConfigError: If a value is invalid for its key.
        """
        return load_world_dict(self.patch(values), self.path, self._urdf)

    def others(self, values: Mapping[str, float], place: str) -> dict[str, float]:
        """Returns values that are no keys of the world, indexed by the rest of their paths.

        Args:
            values: Values of parameters.
            place: `measured`, `inputs` or `dynamics`.
        """
        found = {}
        for name, value in values.items():
            for text in self.config.parameters[name].set:
                first, _, rest = text.partition(".")
                if first == place:
                    found[rest] = value
        return found

    def _find_objects(self) -> None:
        folders = []
        given = self._main.get("setAdditionalSearchPath") or ()
        for folder in [given] if isinstance(given, str) else given:
            folders.append(find_folder(folder, self.path))
        for section in object_sections():
            for index, entry in enumerate(self._main.get(section) or ()):
                parsed = parse_object_entry(entry)
                path = find_file(parsed.file, self.path, tuple(folders))
                data = parsed.apply_overrides(load_object_file(path))
                self._paths[section, index] = path
                self._entries[str(data.get("name"))] = (section, index)
                self._files[str(data.get("name"))] = data


def _with_list(overrides: Mapping[str, Any], file: Mapping[str, Any], steps: Sequence[str | int]) -> dict[str, Any]:
    """Copies the list at the first index of a path from a file into overrides, unless it is there already."""
    first = next(index for index, step in enumerate(steps) if isinstance(step, int))
    below: Any = file
    there: Any = overrides
    for step in steps[:first]:
        below = below.get(step) if isinstance(below, Mapping) else None
        there = there.get(step) if isinstance(there, Mapping) else None
    if isinstance(there, (list, tuple)) or not isinstance(below, (list, tuple)):
        return dict(overrides)
    result: dict[str, Any] = copy.deepcopy(dict(overrides))
    inner = result
    for step in steps[: first - 1]:
        inner = inner.setdefault(str(step), {})
    inner[str(steps[first - 1])] = list(below)
    return result


class SimulatedRun(NamedTuple):
    """Simulated signals at the times of the measurement: poses as rows of 7 numbers, joints as rows of m numbers."""

    signals: Mapping[str, np.ndarray]


class CandidateWorld:
    """The world of one candidate, which simulates measured runs.

    Args:
        template: The world.
        values: Values of all parameters.

    Raises:
        ConfigError: If a value is invalid, or a signal names a link that the world lacks.
    """

    def __init__(self, template: WorldTemplate, values: Mapping[str, float]) -> None:
        self._config = template.config
        self._loaded = template.load(values)
        self._measured = template.others(values, "measured")
        self._delays = template.others(values, "inputs")
        self._dynamics = template.others(values, "dynamics")
        self.world = World(self._loaded, connection_mode=pybullet.DIRECT)
        self._last: tuple[bytes, SimulatedRun] = b"", SimulatedRun({})

    def close(self) -> None:
        """Disconnects from PyBullet."""
        self.world.close()

    def simulate(self, run: MeasuredRun, end_s: float) -> SimulatedRun:
        """Simulates a run.

        Args:
            run: The measured run.
            end_s: Time at which the simulation ends [s].

        Raises:
            InterfaceError: If the simulation diverges, or the world lacks something that the run names.
        """
        dt_s = self.world.clock.dt_s
        times = {signal: self._times(run, signal, end_s) for signal in self._config.measured}
        depends = run.starts or run.joints or run.inputs
        key = b"" if depends else b"".join(signal.encode() + each.tobytes() for signal, each in times.items())
        if key and key == self._last[0]:  # nothing differs from the last run
            return self._last[1]
        self._begin(run)
        needed = {signal: _ticks(time / dt_s) for signal, time in times.items()}
        ticks = sorted(set(np.concatenate([each.ravel() for each in needed.values()]).tolist()))
        inputs = self._inputs(run)
        samples: dict[str, dict[int, np.ndarray]] = {signal: {} for signal in needed}
        wanted = {signal: set(each.ravel().tolist()) for signal, each in needed.items()}
        for tick in ticks:
            while self.world.clock.tick < tick:
                self._advance(tick, inputs)
            for signal, which in wanted.items():
                if tick in which:
                    samples[signal][tick] = self._read(run, signal)
        result = SimulatedRun({s: self._offset(s, _between(samples[s], times[s] / dt_s)) for s in needed})
        self._last = key, result
        return result

    def _begin(self, run: MeasuredRun) -> None:
        world = self.world
        world.reset()
        for signal, start in run.starts.items():
            name = self._config.measured[signal].object if signal in self._config.measured else signal
            configs = [each.config for each in self._loaded.objects if each.config.name == name]
            if not configs or not isinstance(configs[0], DynamicObjectConfig):
                continue
            arm = rotated(start.quaternion, np.array(configs[0].baseInertialFramePosition))
            velocity = start.linear_velocity + np.cross(start.angular_velocity, arm)
            moving = {
                "basePosition": tuple(start.position.tolist()),
                "baseOrientation": tuple(start.quaternion.tolist()),
                "resetBaseVelocity": ResetBaseVelocity(
                    linearVelocity=tuple(velocity.tolist()), angularVelocity=tuple(start.angular_velocity.tolist())
                ),
            }
            world.remove(name)
            world.add("dynamic", configs[0].model_copy(update=moving))
        for signal, track in run.joints.items():
            if signal in self._config.measured:
                name = self._config.measured[signal].object
                world.act(name, "set_joint_state", dict(zip(track.names, track.position[0].tolist())))
        changes: dict[str, dict[str, float]] = {}
        for text, value in self._dynamics.items():
            target, _, key = text.rpartition(".")
            changes.setdefault(target, {})[key] = value
        for target, change in changes.items():
            world.change_dynamics(target, change)

    def _times(self, run: MeasuredRun, signal: str, end_s: float) -> np.ndarray:
        track: PoseTrack | JointTrack | None = run.poses.get(signal) or run.joints.get(signal)
        assert track is not None
        delay_s = self._measured.get(f"{signal}.delay_s", 0.0) - self._config.start_s
        return np.maximum(track.time[track.time <= end_s + 1e-9] - delay_s, 0.0)

    def _inputs(self, run: MeasuredRun) -> list[tuple[int, str, dict[str, float]]]:
        """Returns tick, slot and target of each changed input of a run, the latest tick first."""
        found = []
        for slot, track in run.inputs.items():
            delay_s, last = self._config.start_s + self._delays.get(f"{slot}.delay_s", 0.0), None
            for time_s, row in zip(track.time, track.position):
                if last is not None and (row == last).all():
                    continue
                due = max(0.0, (time_s + delay_s) / self.world.clock.dt_s)
                tick, late = int(due + 1e-6), max(0.0, due - int(due + 1e-6))
                if last is not None and late > 1e-6:  # within a tick, a mean of both targets: smooth in the delay
                    found.append((tick, slot, dict(zip(track.names, (row + late * (last - row)).tolist()))))
                    tick += 1
                found.append((tick, slot, dict(zip(track.names, row.tolist()))))
                last = row
        return sorted(found, key=lambda each: each[0])[::-1]

    def _advance(self, tick: int, inputs: list[tuple[int, str, dict[str, float]]]) -> None:
        world = self.world
        while inputs and inputs[-1][0] <= world.clock.tick:
            _, slot, target = inputs.pop()
            world.put(slot, target)
        until = min(tick, inputs[-1][0]) if inputs else tick
        if not world.run_idle(until - world.clock.tick, math.inf):
            world.step()

    def _read(self, run: MeasuredRun, signal: str) -> np.ndarray:
        config = self._config.measured[signal]
        if signal in run.joints:
            body: Any = self.world.bodies[config.object]
            positions = body.joint_positions()
            return np.array([positions[body.model[name].index] for name in run.joints[signal].names])
        pose = self._pose(config.object)
        if config.frame is not None:
            pose = self._pose(config.frame).inverse() @ pose
        return np.array([*pose.position, *pose.quat_xyzw])

    def _pose(self, target: str) -> Pose:
        name, _, link = target.partition("/")
        body = self.world.bodies[name]
        if not link:
            return body.base_pose()
        links = {body.link_name(index): index for index in (-1, *body.link_indices)}
        if link not in links:
            raise UnknownNameError(f"link of {name}", link, list(links))
        return body.link_pose(links[link])

    def _offset(self, signal: str, rows: np.ndarray) -> np.ndarray:
        for axis in range(min(3, rows.shape[1])):
            rows[:, axis] += self._measured.get(f"{signal}.offset[{axis}]", 0.0)
        return rows


def _ticks(ticks: np.ndarray) -> np.ndarray:
    """Returns the ticks before and after each time, which is given in ticks, shape (n, 2)."""
    near = np.round(ticks)
    ticks = np.where(abs(ticks - near) < 1e-3, near, ticks)
    return np.stack([np.floor(ticks), np.ceil(ticks)], 1).astype(int)


def _between(samples: Mapping[int, np.ndarray], ticks: np.ndarray) -> np.ndarray:
    """Interpolates samples linearly; quaternions change little within a tick."""
    pairs = _ticks(ticks)
    before = np.array([samples[tick] for tick in pairs[:, 0].tolist()])
    after = np.array([samples[tick] for tick in pairs[:, 1].tolist()])
    if before.shape[1] == 7:
        after[:, 3:] *= np.where((before[:, 3:] * after[:, 3:]).sum(1, keepdims=True) < 0.0, -1.0, 1.0)
    return before + (after - before) * np.clip(ticks - pairs[:, 0], 0.0, 1.0)[:, None]


def residuals(config: SignalConfig, measured: PoseTrack | JointTrack, simulated: np.ndarray) -> np.ndarray:
    """Returns differences divided by their standard deviations, shape (n, 6) for poses and (n, m) for joints.

    Orientations differ by the vector part of the relative quaternion, times 2.
    """
    n = len(simulated)
    if isinstance(measured, JointTrack):
        return (simulated - measured.position[:n]) / config.joint_sigma
    position = (simulated[:, :3] - measured.position[:n]) / config.position_sigma
    a, b = simulated[:, 3:] / np.linalg.norm(simulated[:, 3:], axis=1, keepdims=True), measured.quaternion[:n]
    vector = a[:, 3:] * b[:, :3] - b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    sign = np.where((a * b).sum(1, keepdims=True) < 0.0, -1.0, 1.0)
    return np.hstack([position, 2.0 * sign * vector / config.rotation_sigma])


def mean_error(config: SignalConfig, measured: PoseTrack | JointTrack, simulated: np.ndarray) -> float:
    """Returns the mean distance and the mean angle over time, divided by their standard deviations, and added."""
    if isinstance(measured, JointTrack):
        return float(abs(residuals(config, measured, simulated)).mean())
    distance = np.linalg.norm(simulated[:, :3] - measured.position[: len(simulated)], axis=1).mean()
    angle = np.radians(angle_deg(simulated[:, 3:], measured.quaternion[: len(simulated)])).mean()
    return float(distance / config.position_sigma + angle / config.rotation_sigma)
