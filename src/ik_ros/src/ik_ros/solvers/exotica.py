"""The solver `exotica`: solves problems from EXOTica's XML files with the solver `tasks`."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from custom_ros_tools.errors import ConfigError, Problem, UnknownNameError
from custom_ros_tools.schema import ConfigModel, KeyedError, Positive, Switch, Text
from ik_ros.exotica.elements import CostConfig
from ik_ros.exotica.maps import EffFrameMap, LinkMap, MapTask, Situation, TaskMap
from ik_ros.exotica.problem_file import BoundedEndPoseProblem, read_problem
from ik_ros.exotica.scene import ExoticaScene, errors_of
from ik_ros.problem import IKProblem, IKSolution
from ik_ros.solver import Solver
from ik_ros.tasks.formulation import Formulation
from robot_model.asset_files import ExistingFile
from robot_model.geometry import Pose
from robot_model.reach import ORIENTATION_TOLERANCE_RAD, POSITION_TOLERANCE_M

from .tasks import TasksSolver

LEAST_ITERATIONS = 100
MAX_TASKS = 200


class ExoticaConfig(ConfigModel):
    """Options of the solver `exotica`.

    Attributes:
        xml_filename: EXOTica's XML file, with one problem and its solver; `{package}/path` is resolved.
        use_scipy_solver: If true, the weight of a cost is Rho, as in EXOTica's SciPy solver, and the file does not need
            to contain a solver. If false, the weight is the square of Rho.
        scipy_solver_method: Accepted for compatibility, without effect.
        tolerance_m: Largest position error of a link up to which a goal counts as met [m].
        tolerance_rad: Largest rotation error of a link up to which a goal counts as met [rad].
    """

    xml_filename: ExistingFile
    use_scipy_solver: Switch = False
    scipy_solver_method: Text = "SLSQP"
    tolerance_m: Positive = POSITION_TOLERANCE_M
    tolerance_rad: Positive = ORIENTATION_TOLERANCE_RAD


class _Cost(NamedTuple):
    """A cost in the form of tasks of the solver `tasks`, made from a task map and its `CostConfig`.

    Attributes:
        goal: Goal of the map in problems that do not set a goal for the map.
        parts: The tasks that express the map, indexed by task name.
    """

    goal: tuple[float, ...]
    parts: dict[str, MapTask]


class ExoticaSolver(Solver):
    """Solves problems that are defined in EXOTica's XML, by converting task maps to tasks of the solver `tasks`.

    Attributes:
        config: The options.
        maps: All task maps, indexed by name, including task maps without a cost.
        scene: The robot and the additional frames.

    Raises:
        ConfigError: If the solver `tasks` cannot express an element of the XML. The message names file and element.
    """

    Config = ExoticaConfig
    deterministic = True

    def __init__(self, config: ExoticaConfig) -> None:
        self.config = config
        file = read_problem(config.xml_filename)
        try:
            if file.solver is None and not config.use_scipy_solver:
                raise KeyedError("", "expected an IKSolver next to the problem, or the option use_scipy_solver: true")
            kind = type(file.problem).__name__
            with errors_of(f"{kind}.PlanningScene.Scene"):
                self.scene = ExoticaScene(file.problem.PlanningScene[0])
            self.maps: dict[str, TaskMap] = {}
            for task_map in file.problem.Maps:
                if task_map.Name in self.maps:
                    raise KeyedError(f"{kind}.Maps", f"there is another map '{task_map.Name}'")
                self.maps[task_map.Name] = task_map
            self._costs = dict(self._costs_of(file.problem.Cost, f"{kind}.Cost"))
            formulation = self._formulation(file.problem)
        except KeyedError as error:
            raise ConfigError([Problem(config.xml_filename, error.key, error.message)]) from None
        iterations = max(LEAST_ITERATIONS, file.solver.MaxIterations if file.solver else 0)
        formulation["iterations"] = iterations
        self._solver = TasksSolver(Formulation.parse(formulation, config.xml_filename))
        self.joint_names, self.base_frame = self._solver.joint_names, self._solver.base_frame
        self.lower, self.upper = self._solver.lower, self._solver.upper
        self.velocity_limits = self._solver.velocity_limits

    def map_size(self, name: str) -> int:
        """Returns the number of values in a task map's goal."""
        return self.maps[name].size(self.scene)

    def solve(self, problem: IKProblem) -> IKSolution:
        """Searches for joint positions that minimise the costs.

        Raises:
            ValueError: If a goal or frame is invalid, or if the problem has a target but no unique task can take it,
                see `_main_task`.
            UnknownNameError: If the problem names an unknown joint, task map or frame.
        """
        for name in problem.goals:
            if name not in self.maps:
                raise UnknownNameError("task map", name, self.maps)
        self.scene.check_attached(problem.frames)
        start = {**dict.fromkeys(self.joint_names, 0.0), **self._start, **problem.start}
        situation = Situation(self.scene, problem.frames, start, problem.previous)
        goals: dict[str, Sequence[float]] = {}
        for name, cost in self._costs.items():
            values = problem.goals.get(name, cost.goal)
            if len(values) != len(cost.goal):
                raise ValueError(f"goals: {name}: expected {len(cost.goal)} numbers, got {len(values)}")
            for task, part in cost.parts.items():
                if part.goal is None or (problem.target is not None and task == self._main):
                    continue
                try:
                    goals[task] = part.goal(values, situation)
                except ValueError as error:
                    raise ValueError(f"goals: {name}: {error}") from None
        if problem.target is not None and self._main is None:
            raise ValueError("target: expected a problem with one EffFrame, whose weights are equal")
        return self._solver.solve(dataclasses.replace(problem, goals=goals, previous=(), frames={}))

    def _costs_of(self, tasks: Sequence[CostConfig], key: str) -> Iterator[tuple[str, _Cost]]:
        """Converts the XML's cost elements. Yields for each element the name of the task map and the `_Cost`.

        Args:
            tasks: The cost elements.
            key: Key path of the cost elements in the XML, for error messages.
        """
        seen = set()
        for task in tasks:
            name = task.Task
            with errors_of(f"{key}.{name}.Task"):
                if name not in self.maps:
                    raise UnknownNameError("task map", name, self.maps)
                if name in seen:
                    raise ValueError("there is another cost for this map")
            seen.add(name)
            task_map, size = self.maps[name], self.map_size(name)
            weights = task_map.weights(self.scene)
            rho = task.Rho * weights if len(task.Rho) == 1 else task.Rho or (1.0,) * weights
            if len(rho) != weights or min(rho) < 0.0:
                raise KeyedError(f"{key}.{name}.Rho", f"expected 1 or {weights} weights, none below 0; got {list(rho)}")
            if len(task.Goal) not in (0, size):
                raise KeyedError(f"{key}.{name}.Goal", f"expected {size} numbers, got {len(task.Goal)}")
            try:
                parts = list(task_map.parts(self.scene, rho))
            except KeyedError as error:
                raise KeyedError(f"Maps.{name}.{error.key}", error.message) from None
            names = [name] if len(parts) == 1 else [f"{name} ({i + 1})" for i in range(len(parts))]
            yield name, _Cost(task.Goal or (0.0,) * size, dict(zip(names, parts)))

    def _formulation(self, problem: Any) -> dict[str, Any]:
        """Converts the EXOTica problem to options of the solver `tasks`."""
        joints = self.scene.joints
        rhos = [part.rho for cost in self._costs.values() for part in cost.parts.values() if part.rho]
        if not rhos:
            raise KeyedError("Cost", "expected a cost whose Rho is not 0")
        if len(rhos) > MAX_TASKS:
            raise KeyedError("Cost", f"expected at most {MAX_TASKS} frames and maps, got {len(rhos)}")
        of_links = [
            part.rho
            for name, cost in self._costs.items()
            for part in cost.parts.values()
            if self.maps[name].is_about_links
        ]
        frames: list[dict[str, Any]] = []
        costs: list[dict[str, Any]] = []
        for name, cost in self._costs.items():
            for task, part in cost.parts.items():
                options = {"name": task, **part.options, "weight": self._weight(part.rho) / self._weight(max(rhos))}
                if self.maps[name].is_about_links and part.rho == max(of_links):
                    options.update(
                        required=True, tolerance_m=self.config.tolerance_m, tolerance_rad=self.config.tolerance_rad
                    )
                if part.on_link is not None:
                    options["frame"] = part.on_link.link
                    if part.on_link.pose != Pose():
                        link, (position, quat) = part.on_link
                        options["frame"] = name_of_frame = f"frame of {task}"
                        frames.append({"name": name_of_frame, "link": link, "position": position, "orientation": quat})
                costs.append(options)
        self._main = self._main_task()
        self._start = self._state(problem.StartState, "StartState")
        formulation: dict[str, Any] = {
            "urdf_filename": self.scene.robot.urdf_path,
            "joints": list(joints),
            "start": self._start,
            "frames": frames,
            "costs": costs,
        }
        if self._main is not None:
            formulation["main_task"] = self._main
        if isinstance(problem, BoundedEndPoseProblem):
            lower = self._state(problem.LowerBound, "LowerBound")
            upper = self._state(problem.UpperBound, "UpperBound")
            if lower or upper:
                limits = {name: [lower.get(name, -1e9), upper.get(name, 1e9)] for name in joints}
                formulation["constraints"] = [{"name": "bounds", "type": "joint_limits", "limits": limits}]
        return formulation

    def _weight(self, rho: float) -> float:
        return rho if self.config.use_scipy_solver else rho**2  # IKSolver minimises the square of Rho times the error

    def _main_task(self) -> str | None:
        """Returns the name of the task whose goal is set to a problem's target, or None.

        The task is that of the only EffFrame map. Without an EffFrame map, it is that of the only link map. The result
        is None if there are several such maps, or several tasks express the map.
        """
        links = [name for name in self._costs if isinstance(self.maps[name], LinkMap)]
        whole = [name for name in links if isinstance(self.maps[name], EffFrameMap)] or links
        return whole[0] if len(whole) == 1 and list(self._costs[whole[0]].parts) == whole else None

    def _state(self, positions: Sequence[float], key: str) -> dict[str, float]:
        joints = self.scene.joints
        if len(positions) not in (0, len(joints)):
            raise KeyedError(key, f"expected {len(joints)} positions, one for each joint, got {len(positions)}")
        return dict(zip(joints, positions))
