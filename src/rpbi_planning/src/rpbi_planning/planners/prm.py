"""A probabilistic roadmap that is kept over the queries of one scene (Kavraki et al., 1996).

Motions between nodes are proven when a path uses them for the first time (Bohlin and Kavraki, 2000, Lazy PRM).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from pydantic import Field
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from custom_ros_tools.schema import Count
from rpbi_planning.planner import Array, Planner, PlannerConfig, PlanningProblem

TRIES = 20
"""Largest number of random configurations for one new node that is free."""


class PrmConfig(PlannerConfig):
    """Options of the planner `prm`."""

    batch: Count = Field(50, description="Number of nodes that are added when no path is found.")
    neighbours: Count = Field(10, description="Number of nearest nodes to which a node is connected.")
    most: Count = Field(2000, description="Largest number of nodes that are kept for later queries.")


@dataclass
class Roadmap:
    """Free configurations, and what is known of the motions between them.

    Attributes:
        nodes: The configurations.
        edges: Whether the motion between two nodes is proven to be free; None if that was not tried yet.
    """

    nodes: list[Array] = field(default_factory=list)
    edges: dict[tuple[int, int], bool | None] = field(default_factory=dict)

    def add(self, q: Array, neighbours: int) -> int:
        """Adds a node with motions to its nearest neighbours, and returns its number."""
        number = len(self.nodes)
        if number:
            far = ((np.array(self.nodes) - q) ** 2).sum(axis=1)
            for other in np.argsort(far)[:neighbours].tolist():
                self.edges[other, number] = None
        self.nodes.append(q)
        return number


class Prm(Planner):
    """A roadmap, extended until it has a path. Later queries in the unchanged scene use it again."""

    Config = PrmConfig

    def search(self, problem: PlanningProblem) -> Array | None:
        """See `Planner`."""
        roadmap = problem.kept.setdefault("prm", Roadmap())
        if len(roadmap.nodes) > self.config.most:
            roadmap = problem.kept["prm"] = Roadmap()
        generator = np.random.default_rng(problem.seed + len(roadmap.nodes))
        low, high = problem.bounds
        start = roadmap.add(problem.start, self.config.neighbours)
        goals = [roadmap.add(goal, self.config.neighbours) for goal in problem.goals]
        while not problem.is_over:
            if (path := self._shortest(problem, roadmap, start, goals)) is not None:
                return path
            for _ in range(self.config.batch):
                samples = (generator.uniform(low, high) for _ in range(TRIES))
                if (q := next((q for q in samples if problem.model.is_free(q)), None)) is not None:
                    roadmap.add(q, self.config.neighbours)
                if problem.is_over:
                    break
        return None

    def _shortest(self, problem: PlanningProblem, roadmap: Roadmap, start: int, goals: list[int]) -> Array | None:
        """Proves motions on shortest paths until all motions of one are free; None if no path is left."""
        nodes = np.array(roadmap.nodes)
        while not problem.is_over:
            usable = np.array([edge for edge, is_free in roadmap.edges.items() if is_free is not False], int)
            usable = usable.reshape(-1, 2)
            lengths = np.linalg.norm(nodes[usable[:, 0]] - nodes[usable[:, 1]], axis=1) + 1e-9
            graph = csr_matrix((lengths, usable.T), (len(nodes), len(nodes)))
            far, before = dijkstra(graph, False, start, True)
            goal = min(goals, key=lambda each: far[each])
            if not np.isfinite(far[goal]):
                return None
            numbers = [goal]
            while numbers[-1] != start:
                numbers.append(int(before[numbers[-1]]))
            steps = [(min(pair), max(pair)) for pair in zip(numbers, numbers[1:])]
            for edge in steps:
                if roadmap.edges[edge] is None:
                    roadmap.edges[edge] = problem.model.edge(nodes[edge[0]], nodes[edge[1]])
                if not roadmap.edges[edge]:
                    break
            else:
                return nodes[numbers[::-1]]
        return None
