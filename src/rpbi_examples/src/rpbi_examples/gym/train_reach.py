"""Trains a policy that reaches random goals with seven joints, and draws the learning curve.

    .venv/bin/python -m rpbi_examples.gym.train_reach

Training takes about a minute on two processors.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import matplotlib
import numpy as np
import numpy.typing as npt

import rpbi_examples.gym  # registers the environments
from custom_ros_tools.plot_style import plot_style

from .cross_entropy import Array, CrossEntropy, LinearPolicies, run_episodes

ENVIRONMENT = next(name for name in rpbi_examples.gym.ENVIRONMENTS if "Reach" in name)
FEATURES, ACTIONS = 3, 7
UNIT_M = 0.1
"""Distance that corresponds to a feature with the value 1 [m]."""
TESTS = 32
"""Number of test episodes, a multiple of the number of environments."""
FIRST_TEST_SEED = 1_000_000
"""First seed of the test episodes. Training does not use the test seeds."""


class Progress(NamedTuple):
    """Result of the training up to a generation.

    Attributes:
        actions: Number of training actions so far.
        score: Mean return in the test episodes. The tested policy is the mean of the distribution of policies.
        success: Share of test episodes in which the tested policy succeeded.
        seconds: Wall time since the start of the training [s].
    """

    actions: int
    score: float
    success: float
    seconds: float


def features(observations: dict[str, npt.NDArray[np.float32]]) -> Array:
    """Returns the vectors from the tool to the goals in units of `UNIT_M`, shape (n, 3)."""
    return observations["way"].astype(np.float64) / UNIT_M


def train(envs: Any, generations: int, tries: int, seed: int) -> list[Progress]:
    """Trains a policy, and returns the progress before the first generation and after each generation.

    Args:
        envs: Vector of environments, one for each policy of a generation.
        generations: Number of generations.
        tries: Number of episodes of each policy in a generation.
        seed: Seed of the drawn parameters, and seed of the first training episode. Later episodes have the next seeds.
    """
    count, begin_s, actions = envs.num_envs, time.monotonic(), 0
    method = CrossEntropy(FEATURES * ACTIONS, 1.0, 0.25, 0.05, np.random.default_rng(seed))
    found: list[Progress] = []
    for generation in range(generations + 1):
        test = _test(envs, method.mean)
        found.append(Progress(actions, *test, time.monotonic() - begin_s))
        print(f"{generation:3d}: {_line(found[-1])}", flush=True)
        drawn, scores = method.draw(count), np.zeros(count)
        for each in range(tries):
            same = [seed + tries * generation + each] * count
            episodes = run_episodes(envs, LinearPolicies(drawn, FEATURES), features, same)
            scores += episodes.returns / tries
            actions += episodes.actions
        method.update(drawn, scores)
    return found


def _test(envs: Any, parameters: Array) -> tuple[float, float]:
    """Runs the test episodes with one policy, and returns the mean return and the share of successes."""
    policies = LinearPolicies(np.tile(parameters, (envs.num_envs, 1)), FEATURES)
    seeds = np.arange(FIRST_TEST_SEED, FIRST_TEST_SEED + TESTS).reshape(-1, envs.num_envs).tolist()
    found = [run_episodes(envs, policies, features, each) for each in seeds]
    return float(np.mean([each.returns for each in found])), float(np.mean([each.successes for each in found]))


def _line(progress: Progress) -> str:
    actions, score, success, seconds = progress
    return f"{actions:7d} actions, {seconds:4.0f} s, return {score:6.2f}, success {100 * success:3.0f} %"


@plot_style()
def draw(progress: list[Progress], file: Path) -> None:
    """Writes a picture of the test returns and successes over the number of training actions."""
    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (score, success) = pyplot.subplots(2, 1, sharex=True, figsize=(8.0, 4.4), layout="constrained")
    actions = [each.actions / 1000 for each in progress]
    score.plot(actions, [each.score for each in progress], "o-", ms=4)
    score.set(ylabel="return", title=f"{ENVIRONMENT}: means of {TESTS} test episodes")
    success.plot(actions, [100 * each.success for each in progress], "o-", ms=4)
    success.set(xlabel="actions used to learn [thousands]", ylabel="success [%]", ylim=(-3, 103))
    figure.savefig(file)


def main() -> None:
    """Trains a policy with options of the command line, and writes the learning curve."""
    parser = argparse.ArgumentParser(description="Learns to reach random goals.")
    parser.add_argument("--generations", type=int, default=25)
    parser.add_argument("--policies", type=int, default=8, help="policies of a generation")
    parser.add_argument("--tries", type=int, default=1, help="episodes of each policy in a generation")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("gym_curve.png"), help="picture of the learning curve")
    chosen = parser.parse_args()
    envs = gymnasium.make_vec(ENVIRONMENT, num_envs=chosen.policies, workers=chosen.workers)
    progress = train(envs, chosen.generations, chosen.tries, chosen.seed)
    envs.close()
    draw(progress, chosen.out)


if __name__ == "__main__":
    main()
