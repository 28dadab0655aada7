"""Finds the largest push after which Talos stands, by direction: `python -m rpbi_examples.balance.largest_push`.

The scene `talos` decides: both feet are where they were, the torso is upright, and the hand is back and stays.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator

from rpbi.gym.env import WorldEnv
from rpbi_examples.scenes.scene import run_scene
from rpbi_examples.scenes.talos import Talos
from rpbi_examples.scenes.task import EnvStage, SceneTask, make_env

DIRECTIONS = ("forward", "forward left", "left", "back left", "back", "back right", "right", "forward right")
"""Where pushes go to, each 45 degrees farther to the left."""
MOST, STEP = 80.0, 2.5
"""Largest impulse that is tried, and how exactly the largest one is found [N s]."""


def stands(env: WorldEnv, seed: int, angle: float, impulse: float) -> bool:
    """Returns whether the scene succeeds with a push.

    Args:
        env: Environment of the scene.
        seed: Seed of everything but the push.
        angle: Where the push goes to, from where the robot faces, to its left [rad].
        impulse: Impulse of the push [N s].
    """
    assert isinstance(env.task, SceneTask)
    env.task.seed = seed
    env.reset(seed=seed)
    scene = env.task.scene
    assert isinstance(scene, Talos)
    scene.push_angle, scene.impulse = angle, impulse
    return run_scene(scene, EnvStage(env)).success


def largest_push(env: WorldEnv, seed: int, angle: float) -> float:
    """Returns the largest impulse after which it stands [N s], to `STEP`, by bisection; see `stands`."""
    good, bad = 0, round(MOST / STEP)
    while bad - good > 1:
        middle = (good + bad) // 2
        if stands(env, seed, angle, middle * STEP):
            good = middle
        else:
            bad = middle
    return good * STEP


def table(seed: int) -> Iterator[str]:
    """Yields the lines of a table in Markdown: the largest impulse by direction."""
    env = make_env("talos")
    yield "| push to | largest impulse [N s] |"
    yield "|---|---|"
    for index, name in enumerate(DIRECTIONS):
        yield f"| {name} | {largest_push(env, seed, math.radians(45.0 * index)):g} |"
    env.close()


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description="Finds the largest push that Talos withstands, by direction.")
    parser.add_argument("--seed", type=int, default=1, help="seed of the start and the target (default: 1)")
    for line in table(parser.parse_args().seed):
        print(line, flush=True)


if __name__ == "__main__":
    main()
