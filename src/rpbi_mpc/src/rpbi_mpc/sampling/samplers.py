"""Samplers, which draw candidates around a nominal plan and improve the plan from the candidates' costs.

A plan is a matrix of shape (k, m): the m numbers of a command at k equidistant times, the knots. Each number is a share
of the range between the limits, from 0 (lower limit) to 1 (upper limit).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from custom_ros_tools.plugin_table import PluginTable
from custom_ros_tools.schema import ConfigModel, KeyedError


class SamplerConfig(ConfigModel):
    """Options that all samplers have in common."""

    candidates: Annotated[int, Field(ge=2)] = Field(
        16, description="Number of plans that are simulated in each iteration."
    )
    iterations: Annotated[int, Field(ge=1)] = Field(
        1, description="Number of iterations that improve the plan in a cycle."
    )
    noise: Annotated[float, Field(gt=0, le=1)] = Field(
        0.1,
        description="Standard deviation of the random values at each knot, as a fraction of the range between the "
        "limits.",
    )


class Sampler(ABC):
    """Draws candidates around a nominal plan, and improves the plan from the candidates' costs.

    Args:
        config: Options of the sampler.
        shape: Shape (k, m) of a plan.
    """

    Config: type[SamplerConfig] = SamplerConfig

    def __init__(self, config: SamplerConfig, shape: tuple[int, int]) -> None:
        self.config = config
        self.shape = shape

    def begin(self) -> None:  # noqa: B027 (optional)
        """Prepares the sampler for a new cycle. Does nothing by default."""

    def draw(self, nominal: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Draws candidates within the limits, shape (candidates, k, m). The first candidate is the nominal plan."""
        noise = random.standard_normal((self.config.candidates, *self.shape)) * self.deviation
        noise[0] = 0.0
        return np.clip(nominal + noise, 0.0, 1.0)

    @property
    def deviation(self) -> float | np.ndarray:
        """Standard deviation of the next candidates, a number or an array of shape (k, m)."""
        return self.config.noise

    @abstractmethod
    def improve(self, candidates: np.ndarray, costs: np.ndarray) -> np.ndarray:
        """Computes the new nominal plan, shape (k, m).

        Args:
            candidates: Candidates with finite costs, shape (n, k, m).
            costs: Cost of each candidate, shape (n,).
        """


class PredictiveSampler(Sampler):
    """Adopts the best candidate as plan (Howell et al., Predictive Sampling, arXiv 2212.00541, algorithm 1)."""

    def improve(self, candidates: np.ndarray, costs: np.ndarray) -> np.ndarray:
        best: np.ndarray = candidates[np.argmin(costs)]
        return best


class CemConfig(SamplerConfig):
    """Options of the cross-entropy method."""

    iterations: Annotated[int, Field(ge=1)] = Field(
        3, description="Number of iterations that improve the plan in a cycle."
    )
    elites: Annotated[int, Field(ge=1)] = Field(
        4, description="Number of best candidates, whose mean becomes the plan."
    )
    least_noise: Annotated[float, Field(gt=0, le=1)] = Field(
        0.01,
        description="Least standard deviation of the random values, as a fraction of the range between the limits.",
    )

    @model_validator(mode="after")
    def _has_enough_candidates(self) -> CemConfig:
        if self.elites > self.candidates:
            raise KeyedError("elites", f"expected at most the {self.candidates} candidates, got {self.elites}")
        return self


class CemSampler(Sampler):
    """The cross-entropy method (Rubinstein 1999; Kobilarov 2012): the plan is the mean of the best candidates.

    In the next iteration of the same cycle, candidates are drawn with the standard deviation of the best candidates.
    """

    Config = CemConfig
    config: CemConfig

    def begin(self) -> None:
        self._deviation = np.full(self.shape, self.config.noise)

    @property
    def deviation(self) -> np.ndarray:
        return self._deviation

    def improve(self, candidates: np.ndarray, costs: np.ndarray) -> np.ndarray:
        elites = candidates[np.argsort(costs, kind="stable")[: self.config.elites]]
        self._deviation = np.maximum(elites.std(axis=0), self.config.least_noise)
        mean: np.ndarray = elites.mean(axis=0)
        return mean


class MppiConfig(SamplerConfig):
    """Options of model predictive path integral control (MPPI)."""

    temperature: Annotated[float, Field(gt=0)] = Field(
        0.1,
        description="Difference in cost that reduces a candidate's weight to 1/e, as a fraction of the spread of all "
        "costs.",
    )


class MppiSampler(Sampler):
    """Model predictive path integral control: the plan is a weighted mean of all candidates.

    The weights are exp(-cost / temperature). The temperature is relative to the spread of the costs, so that the costs
    may have any unit.

    Source of the weights: Williams et al., Information-Theoretic MPC, IEEE T-RO 34 (2018), algorithm 2, here without
    control costs.
    """

    Config = MppiConfig
    config: MppiConfig

    def improve(self, candidates: np.ndarray, costs: np.ndarray) -> np.ndarray:
        above = costs - costs.min()
        weights = np.exp(-above / max(self.config.temperature * above.max(), np.finfo(float).tiny))
        mean: np.ndarray = np.tensordot(weights / weights.sum(), candidates, 1)
        return mean


SAMPLERS: PluginTable[Sampler] = PluginTable(
    "sampler",
    "rpbi_mpc.sampling.samplers:Sampler",
    {
        "predictive": "rpbi_mpc.sampling.samplers:PredictiveSampler",
        "cem": "rpbi_mpc.sampling.samplers:CemSampler",
        "mppi": "rpbi_mpc.sampling.samplers:MppiSampler",
    },
)
"""Samplers, indexed by name."""
