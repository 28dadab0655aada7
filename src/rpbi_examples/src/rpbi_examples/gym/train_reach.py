"""Learns to reach random goals by seven joints, from nothing, and draws the learning curve.

    .venv/bin/python -m rpbi_examples.gym.train_reach

It takes some minutes on two processors.
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

from .cross_entropy import Array, CrossEntropy, LinearPolicies, run_episodes

ENVIRONMENT = next(name for name in rpbi_examples.gym.ENVIRONMENTS if "Reach" in name)
ROBOT = "kuka_lwr"
JOINTS = 7
SCALE = np.array([0.1] * 3 + [0.5] * JOINTS)
"""Units of the features: way to the goal [m], joint positions from the start [rad]."""
START = np.radians([0.0, 30.0, 0.0, -90.0, 0.0, 60.0, 0.0])
FIRST_TEST_SEED = 1_000_000
"""Seeds of goals on which nothing is learned."""


class Progress(NamedTuple):
    """Result of a generation.

    Attributes:
        actions: Actions so far, those of tests included.
        score: Mean return of the policies that were drawn.
        success: Share of test goals that the mean policy reached.
        seconds: Time so far [s].
    """

    actions: int
    score: float
    success: float
    seconds: float


def features(observations: dict[str, npt.NDArray[np.float32]]) -> Array:
    """Returns way to the goal and joint positions, shape (n, 10)."""
    positions = observations[f"{ROBOT}/joints"][:, :JOINTS] - START
    return np.hstack([observations["way"], positions]).astype(np.float64)


def train(envs: Any, generations: int, goals: int, seed: int) -> list[Progress]:
    """Learns, and returns the progress of each generation.

    Args:
        envs: Environments, one for each policy of a generation.
        generations: Their number.
        goals: Goals on which each policy is tried in a generation.
        seed: Seed of everything.
    """
    count, begin_s, actions = envs.num_envs, time.monotonic(), 0
    method = CrossEntropy(LinearPolicies.size(len(SCALE), JOINTS), 1.0, 0.2, 0.02, np.random.default_rng(seed))
    found: list[Progress] = []
    for generation in range(generations):
        drawn = method.draw(count)
        scores = np.zeros(count)
        for goal in range(goals):
            same = [seed + goals * generation + goal] * count
            episodes = run_episodes(envs, LinearPolicies(drawn, SCALE, JOINTS), features, same)
            scores += episodes.returns / goals
            actions += episodes.actions
        method.update(drawn, scores)
        mean = LinearPolicies(np.tile(method.mean, (count, 1)), SCALE, JOINTS)
        test = run_episodes(envs, mean, features, range(FIRST_TEST_SEED, FIRST_TEST_SEED + count))
        actions += test.actions
        found.append(Progress(actions, scores.mean(), test.successes.mean(), time.monotonic() - begin_s))
        print(f"{generation + 1:3d}: return {found[-1].score:7.2f}, {100 * found[-1].success:3.0f} % of test goals, "
              f"{actions} actions, {found[-1].seconds:.0f} s", flush=True)  # fmt: skip
    return found


def draw(progress: list[Progress], file: Path) -> None:
    """Draws returns and successes over the number of actions."""
    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (score, success) = pyplot.subplots(2, 1, sharex=True, figsize=(7.0, 4.5), layout="constrained")
    actions = [each.actions / 1000 for each in progress]
    score.plot(actions, [each.score for each in progress], color="tab:blue")
    score.set_ylabel("mean return")
    success.plot(actions, [100 * each.success for each in progress], color="tab:green")
    success.set(xlabel="actions [thousands]", ylabel="test goals reached [%]", ylim=(0, 103))
    for axes in (score, success):
        axes.grid(alpha=0.3)
    figure.savefig(file, dpi=110)


def main() -> None:
    """Learns, and draws the curve."""
    parser = argparse.ArgumentParser(description="Learns to reach random goals.")
    parser.add_argument("--generations", type=int, default=40)
    parser.add_argument("--policies", type=int, default=32, help="policies of a generation")
    parser.add_argument("--goals", type=int, default=3, help="goals that each is tried on")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("gym_curve.png"), help="picture of the learning curve")
    chosen = parser.parse_args()
    envs = gymnasium.make_vec(ENVIRONMENT, num_envs=chosen.policies, workers=chosen.workers)
    progress = train(envs, chosen.generations, chosen.goals, chosen.seed)
    envs.close()
    draw(progress, chosen.out)


if __name__ == "__main__":
    main()
