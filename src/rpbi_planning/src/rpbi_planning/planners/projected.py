"""RRT-Connect among configurations that keep path constraints.

New configurations are projected onto the constraints, and each step is proven to keep them (Berenson, Srinivasa and
Kuffner, 2011, Task space regions: constrained bidirectional RRT).
"""

from __future__ import annotations

import numpy as np
from pydantic import Field

from custom_ros_tools.schema import Positive
from rpbi_planning.constraints import project
from rpbi_planning.planner import Array, Planner, PlannerConfig, PlanningProblem

GREEDY = 200
"""Largest number of steps towards one sample."""


class ProjectedConfig(PlannerConfig):
    """Options of the planner `projected`."""

    step: Positive = Field(0.25, description="Length of a step in joint space [rad or m].")


def bridge(start: Array, end: Array, problem: PlanningProblem, step: float) -> Array | None:
    """Returns waypoints between two configurations, in projected and proven steps; None if a step fails.

    Args:
        start: The first configuration.
        end: The last configuration.
        problem: Constraints, and the proof of motions.
        step: Length of a step [rad or m].
    """
    path, model = [start], problem.model
    while (far := float(np.linalg.norm(end - path[-1]))) > step and not problem.is_over:
        q = project(path[-1] + step / far * (end - path[-1]), problem.group, problem.constraints)
        if q is None or float(np.linalg.norm(end - q)) > far - 0.1 * step:
            return None
        if not (model.is_free(q) and model.edge(path[-1], q)):
            return None
        path.append(q)
    return np.array([*path, end]) if model.edge(path[-1], end) else None


class _Tree:
    def __init__(self, roots: Array) -> None:
        self.nodes, self.parents = [*roots], [-1] * len(roots)

    def nearest(self, q: Array) -> int:
        return int(np.argmin(((np.array(self.nodes) - q) ** 2).sum(axis=1)))

    def add(self, q: Array, parent: int) -> int:
        self.nodes.append(q)
        self.parents.append(parent)
        return len(self.nodes) - 1

    def path(self, node: int) -> list[Array]:
        found = []
        while node >= 0:
            found.append(self.nodes[node])
            node = self.parents[node]
        return found


class ProjectedRrt(Planner):
    """RRT-Connect with projection; without constraints, plain RRT-Connect."""

    Config = ProjectedConfig
    keeps_constraints = True

    def search(self, problem: PlanningProblem) -> Array | None:
        """See `Planner`."""
        generator = np.random.default_rng(problem.seed)
        low, high = problem.bounds
        trees = [_Tree(problem.start[None]), _Tree(problem.goals)]
        is_turned = False
        while not problem.is_over:
            sample = generator.uniform(low, high)
            first, second = trees[::-1] if is_turned else trees
            reached = self._grow(problem, first, sample)
            target = first.nodes[reached]
            other = self._grow(problem, second, target)
            if np.abs(second.nodes[other] - target).max() < 1e-9:
                ends = first.path(reached)[::-1] + second.path(other)[1:]
                return np.array(ends[::-1] if is_turned else ends)
            is_turned = not is_turned
        return None

    def _grow(self, problem: PlanningProblem, tree: _Tree, target: Array) -> int:
        """Adds steps towards a target until one fails, and returns the last node."""
        node = tree.nearest(target)
        for _ in range(GREEDY):
            q = tree.nodes[node]
            ahead = target - q
            far = float(np.linalg.norm(ahead))
            if far < 1e-9 or problem.is_over:
                break
            step = min(1.0, self.config.step / far)
            new = target if step == 1.0 else project(q + step * ahead, problem.group, problem.constraints)
            if new is None or float(np.linalg.norm(target - new)) > far - 0.1 * self.config.step * (step < 1.0):
                break
            if not (problem.model.is_free(new) and problem.model.edge(q, new)):
                break
            node = tree.add(new, node)
        return node
