"""The command `score`: runs a scene from many random starts and counts the successes."""

from __future__ import annotations

import os
import sys
from contextlib import closing
from pathlib import Path
from typing import Annotated, Any

from tqdm import tqdm

from custom_ros_tools.console.argument import Argument, UsageError
from custom_ros_tools.errors import UnknownNameError
from rpbi_examples.scenes import SCENES

INTERRUPTED = 130
"""Exit code after Ctrl-C, as in a shell."""


def score(
    scene: Annotated[str, Argument("SCENE", choices=lambda: SCENES, is_open=True)],
    *,
    seeds: Annotated[str, Argument("A-B")] = "1-100",
    json: Annotated[Path | None, Argument("FILE", parse=Path, files="*.json")] = None,
    out: Annotated[Path, Argument("FOLDER", parse=Path, files="*")] = Path("out/score"),
    noise: Annotated[bool, Argument("")] = False,
    jobs: Annotated[int | None, Argument("N", parse=int)] = None,
) -> int:
    """Runs episodes of a scene with random starts as fast as possible, and reports the number of successes.

        ./rpbi score cup --seeds 1-100 --json cup.json

    A ROS master is not needed. Success is determined from the true state of the simulation. The same seed leads to the
    same episode in any process, also with the scene's launch file: `./rpbi launch cup seed:=17`. The picture
    FOLDER/SCENE_failures.png shows the last camera images of failed episodes. After Ctrl-C, the command reports the
    episodes that have ended. See docs/scenes.md.

    Usage:
        ./rpbi score SCENE [--seeds A-B] [--json FILE] [--out FOLDER] [--noise] [--jobs N]

    Args:
        scene: {choices}; or module:Class for your own scene
        seeds: a range of seeds such as 1-100, or one seed; default 1-100
        json: file for the results, with a row for each seed
        out: folder for the pictures; default out/score
        noise: poses are sensed with noise and delay, as with noise:=true in the launch file
        jobs: number of processes, each of which runs one episode at a time; default: number of processors
    """
    if ":" not in scene and scene not in SCENES:
        raise UnknownNameError("scene", scene, list(SCENES))
    numbers = _numbers(seeds)
    if jobs is not None and jobs < 1:
        raise UsageError(f"--jobs: expected at least 1, got {jobs}")
    from rpbi_examples.scenes.evaluation import run_seeds, summary, write_failures, write_json  # needs Gymnasium

    SCENES.find(scene)  # imported here for an error that names a missing extra
    results, code = [], 0
    period_s = 0.1 if sys.stderr.isatty() else 10.0
    try:
        with (
            tqdm(total=len(numbers), unit=" episodes", leave=False, mininterval=period_s) as bar,
            closing(run_seeds(scene, numbers, min(jobs or os.cpu_count() or 1, len(numbers)), noise)) as running,
        ):
            for each in running:
                results.append(each)
                bar.update()
    except KeyboardInterrupt:
        code = INTERRUPTED
    if not results:
        return code
    found = summary(scene, results, noise)
    _print(found["rows"])
    print(
        f"{scene}{' with noise' * noise}: {found['success']} of {found['of']}",
        *[f"({len(results)} of {len(numbers)} seeds)"] * (code > 0),
    )
    if json:
        write_json(json, found)
    pictures = out / f"{scene.replace(':', '.')}_failures.png"
    if line := write_failures(pictures, results):
        print(line)
    return code


def _numbers(text: str) -> range:
    ends = text.split("-")
    try:
        numbers = range(int(ends[0]), int(ends[-1]) + 1) if len(ends) <= 2 else range(0)
    except ValueError:
        numbers = range(0)
    if not numbers:
        raise UsageError(f"--seeds: expected seeds such as 1-100, or one, got '{text}'")
    return numbers


def _print(rows: list[dict[str, Any]]) -> None:
    """Prints the rows as a table, without state hashes. The last column states the result in words."""
    hidden = {"reason", "state_hash", "success", "done", "of"}
    names = [name for name in dict.fromkeys(name for row in rows for name in row) if name not in hidden]
    lines = [[*(f"{row[name]:g}" if name in row else "-" for name in names), _verdict(row)] for row in rows]
    widths = [max(map(len, column)) for column in zip(names, *(line[:-1] for line in lines))]
    for line in [[*names, "result"], *lines]:
        print("  ".join(f"{each:>{width}}" for each, width in zip(line, widths)) + f"  {line[-1]}")


def _verdict(row: dict[str, Any]) -> str:
    parts = "" if row["of"] == 1 else f" {row['done']} of {row['of']}"
    return f"{'ok' if row['success'] else 'failed'}{parts}{': ' if row['reason'] else ''}{row['reason']}"
