"""The cross-entropy method for learning parameters, and linear policies for vectorised environments."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class CrossEntropy:
    """Draws parameter vectors from a normal distribution, and moves the distribution towards the best vectors.

    Args:
        size: Number of parameters in a vector.
        deviation: Initial standard deviation of each parameter. The initial mean is 0.
        elite: Share of the drawn vectors that count as the best.
        floor: Lower bound of the standard deviations.
        random: Random generator for the drawn vectors.
        rate: Step size of an update: 1 adopts the mean and deviation of the best vectors, 0 changes nothing.
    """

    def __init__(
        self,
        size: int,
        deviation: float,
        elite: float,
        floor: float,
        random: np.random.Generator,
        rate: float = 0.7,
    ) -> None:
        self.mean, self.deviation = np.zeros(size), np.full(size, deviation)
        self._elite, self._floor, self._random, self._rate = elite, floor, random, rate

    def draw(self, count: int) -> Array:
        """Draws parameter vectors, shape (count, size)."""
        return self.mean + self.deviation * self._random.normal(size=(count, len(self.mean)))

    def update(self, parameters: Array, scores: Array) -> None:
        """Moves the distribution towards the parameter vectors with the highest scores.

        Args:
            parameters: Drawn vectors, shape (count, size).
            scores: Score of each vector, shape (count,).
        """
        best = parameters[np.argsort(scores)[-max(2, round(self._elite * len(scores))) :]]
        self.mean += self._rate * (best.mean(axis=0) - self.mean)
        deviation = self.deviation + self._rate * (best.std(axis=0) - self.deviation)
        self.deviation = np.maximum(deviation, self._floor)


class LinearPolicies:
    """One linear policy for each of n environments: action = tanh(W features).

    Args:
        parameters: The matrix W of each policy, flattened row by row, shape (n, actions * features).
        features: Number of features.
    """

    def __init__(self, parameters: Array, features: int) -> None:
        self._weights = parameters.reshape(len(parameters), -1, features)

    def __call__(self, features: Array) -> Array:
        """Returns the actions, shape (n, actions), for features of shape (n, features)."""
        return np.tanh(np.einsum("naf,nf->na", self._weights, features))


class Episodes(NamedTuple):
    """Results of n episodes, one in each environment.

    Attributes:
        returns: Sum of each episode's rewards, shape (n,).
        successes: Whether each episode succeeded, shape (n,).
        actions: Total number of actions in all episodes.
    """

    returns: Array
    successes: npt.NDArray[np.bool_]
    actions: int


def run_episodes(envs: Any, policies: Any, features: Any, seeds: Sequence[int]) -> Episodes:
    """Runs one episode in each environment, and returns the results.

    Args:
        envs: A vector of n environments.
        policies: Function from features, shape (n, features), to actions, shape (n, actions).
        features: Function from the observations of all environments to features, shape (n, features).
        seeds: A seed for each environment.
    """
    observations, infos = envs.reset(seed=list(seeds))
    returns, successes = np.zeros(envs.num_envs), np.zeros(envs.num_envs, bool)
    runs, count = np.ones(envs.num_envs, bool), 0
    while runs.any():
        actions = policies(features(observations)).astype(np.float32)
        observations, rewards, ends, truncations, infos = envs.step(actions)
        returns += np.where(runs, rewards, 0.0)
        successes |= runs & infos["is_success"]
        count += int(runs.sum())
        runs &= ~(ends | truncations)
    return Episodes(returns, successes, count)
