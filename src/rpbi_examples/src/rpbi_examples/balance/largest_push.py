"""Finds the largest push that Talos withstands in each direction: `python -m rpbi_examples.balance.largest_push`.

Talos withstands a push if an episode of the scene `talos` succeeds: the feet have not moved, the torso is upright, and
the hand is at rest at its target.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from matplotlib.figure import Figure

from custom_ros_tools.plot_style import ORANGE, plot_style
from rpbi.gym.env import WorldEnv
from rpbi_examples.scenes.scene import run_scene
from rpbi_examples.scenes.talos import IMPULSE, Talos
from rpbi_examples.scenes.task import EnvStage, SceneTask, make_env

DIRECTIONS = ("forward", "forward left", "left", "back left", "back", "back right", "right", "forward right")
"""Directions of the pushes, counter-clockwise in steps of 45 degrees."""
MOST, STEP = 80.0, 2.5
"""Upper bound of the impulses that are tried, and resolution of the result [N s]."""


def stands(env: WorldEnv, seed: int, angle: float, impulse: float) -> bool:
    """Runs an episode with a given push, and returns whether the episode succeeds.

    Args:
        env: Environment of the scene `talos`.
        seed: Seed of the episode's random start and target; the seed does not affect the push.
        angle: Angle of the push from the robot's forward direction, positive to the left [rad].
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
    """Finds the largest impulse [N s] that the robot withstands, by bisection with the resolution `STEP`.

    Args:
        env: Environment of the scene `talos`.
        seed: Seed of all episodes.
        angle: Angle of the push from the robot's forward direction, positive to the left [rad].
    """
    good, bad = 0, round(MOST / STEP)
    while bad - good > 1:
        middle = (good + bad) // 2
        if stands(env, seed, angle, middle * STEP):
            good = middle
        else:
            bad = middle
    return good * STEP


def table(seed: int) -> Iterator[str]:
    """Yields the lines of a Markdown table with the largest withstood impulse for each direction [N s]."""
    env = make_env("talos")
    yield "| push to | largest impulse [N s] |"
    yield "|---|---|"
    for index, name in enumerate(DIRECTIONS):
        yield f"| {name} | {largest_push(env, seed, math.radians(45.0 * index)):g} |"
    env.close()


def pushes_in(text: str) -> dict[str, float]:
    """Parses the output of `table`, and returns the largest impulse [N s] indexed by direction.

    Raises:
        ValueError: If a direction is missing.
    """
    found = {name: re.search(rf"^\| {name} \| ([\d.]+) \|$", text, re.MULTILINE) for name in DIRECTIONS}
    if missing := [name for name, match in found.items() if match is None]:
        raise ValueError(f"expected a row '| {missing[0]} | N s |' as the command prints it, found none")
    return {name: float(match[1]) for name, match in found.items() if match}


@plot_style()
def draw(pushes: Mapping[str, float], path: Path) -> None:
    """Writes a polar plot of the largest impulses [N s]. The robot is seen from above and faces up.

    Args:
        pushes: Largest impulse [N s], indexed by direction.
        path: Picture file to write.
    """
    figure = Figure(figsize=(5.2, 5.2), layout="constrained")
    axes = figure.add_subplot(projection="polar")
    axes.set_theta_zero_location("N")
    angles = [math.radians(45.0 * DIRECTIONS.index(name)) for name in pushes]
    impulses = list(pushes.values())
    axes.fill(angles, impulses, alpha=0.25)
    axes.plot([*angles, angles[0]], [*impulses, impulses[0]], "o-")
    axes.plot(
        [math.radians(each) for each in range(361)], [IMPULSE] * 361, "--", color=ORANGE, label="push of the scene"
    )
    axes.set_xticks(angles, [f"{name}\n{impulse:g}" for name, impulse in pushes.items()])
    axes.tick_params(axis="x", pad=16)
    axes.set_yticks([10, 20, 30, 40])
    axes.set_rlabel_position(112.5)
    axes.set_title("Largest push that a Talos withstands [N s]", loc="center")
    axes.legend(loc="lower left", bbox_to_anchor=(-0.15, -0.15))
    figure.savefig(path)


def main() -> None:
    """Prints a table of the largest pushes, or reads such a table from the file `--table`. `--out` plots the table."""
    parser = argparse.ArgumentParser(description="Finds the largest push that Talos withstands, by direction.")
    parser.add_argument("--seed", type=int, default=1, help="seed of the start and the target (default: 1)")
    parser.add_argument("--out", type=Path, help="picture of the table")
    parser.add_argument("--table", type=Path, help="file with a table that was printed before, instead of pushes")
    chosen = parser.parse_args()
    lines = []
    if chosen.table:
        lines = [chosen.table.read_text()]
    else:
        for line in table(chosen.seed):
            print(line, flush=True)
            lines.append(line)
    if chosen.out:
        draw(pushes_in("\n".join(lines)), chosen.out)


if __name__ == "__main__":
    main()
