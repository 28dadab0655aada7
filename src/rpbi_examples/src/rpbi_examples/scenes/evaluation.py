"""Runs a scene with many seeds in separate processes, and reports the success rate."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image, ImageDraw

from custom_ros_tools.errors import InterfaceError
from rpbi.gym.env import WorldEnv

from .scene import SceneResult, broken_off
from .task import SceneTask, make_env, run_episode

COLUMNS, MAX_PICTURES = 4, 24
"""Number of columns, and largest number of pictures, in the image of failed episodes."""
PICTURE_PX = (320, 240)


class SeedResult(NamedTuple):
    """Result of the episode with one seed.

    Attributes:
        seed: Seed of the episode.
        result: Result of the episode.
        state_hash: Hash of the world's state at the end of the episode. Empty if the world raised an error.
        picture: Camera image at the end of a failed episode: uint8, shape (height, width, 3). None after a success, and
            if the world raised an error.
    """

    seed: int
    result: SceneResult
    state_hash: str
    picture: np.ndarray | None

    def row(self) -> dict[str, Any]:
        """Returns the result as plain data, for JSON."""
        result = self.result
        figures = {name: round(float(value), 4) for name, value in result.figures.items()}
        return {
            "seed": self.seed,
            "success": result.success,
            "done": result.done,
            "of": result.of,
            "time_s": round(result.time_s, 3),
            **figures,
            "reason": result.reason,
            "state_hash": self.state_hash,
        }


def run_seeds(scene: str, seeds: Sequence[int], jobs: int, noise: bool = False) -> Generator[SeedResult, None, None]:
    """Runs an episode of a scene with each seed, and yields the results in the order of arrival.

    Closing the generator ends its processes. If the world raises an error, the episode counts as failed, and the next
    episode runs in a new world.

    Args:
        scene: A name of `SCENES`, or `module:Class`.
        seeds: Seeds of the episodes.
        jobs: Number of processes. With 1, the episodes run in this process.
        noise: Whether poses are sensed with noise and delay.

    Raises:
        InterfaceError: If the world cannot be made, or a process has ended unexpectedly.
    """
    if jobs == 1:
        try:
            for seed in seeds:
                yield _run(scene, seed, noise)
        finally:
            _close()
        return
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # threads of small matrices would contend for the processors
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(jobs, context, initializer=_end_with_parent)
    try:
        with _interrupts_blocked():
            running = [pool.submit(_run, scene, seed, noise) for seed in seeds]
        for done in as_completed(running):
            yield done.result()
    except BrokenProcessPool:
        raise InterfaceError("a process that ran the scene has ended: its memory may have run out") from None
    finally:
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()  # in the middle of an episode, after an error or Ctrl-C
        pool.shutdown()


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Blocks SIGINT for the duration of the `with` block. Processes that are started in the block keep SIGINT blocked,
    since their parent handles Ctrl-C.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_parent() -> None:
    """Starts a thread that ends this process as soon as the parent process has ended, even after a crash."""

    def wait() -> None:
        parent = multiprocessing.parent_process()
        assert parent is not None
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


_env: WorldEnv | None = None
"""The environment in which this process runs episodes. None before the first episode, and after an error."""


def _close() -> None:
    global _env
    if _env is not None:
        _env.close()
    _env = None


def _run(scene: str, seed: int, noise: bool) -> SeedResult:
    """Runs an episode in the environment of this process, and returns the result.

    Creates the environment before the first episode, and again after an error.
    """
    global _env
    _env = _env or make_env(scene, "rgb_array", noise)
    try:
        result = run_episode(_env, seed)
        return SeedResult(seed, result, _env.world.state_hash(), None if result.success else _env.render())
    except InterfaceError as error:
        assert isinstance(_env.task, SceneTask)
        result = broken_off(_env.task.scene, error)
        _close()
        return SeedResult(seed, result, "", None)


def summary(scene: str, results: Sequence[SeedResult], noise: bool = False) -> dict[str, Any]:
    """Returns a summary as plain data: one row for each seed, and the number of completed parts and the number of all
    parts of the task, both summed over all episodes.
    """
    rows = [each.row() for each in sorted(results, key=lambda each: each.seed)]
    return {
        "scene": scene,
        "noise": noise,
        "success": sum(row["done"] for row in rows),
        "of": sum(row["of"] for row in rows),
        "seeds": len(rows),
        "rows": rows,
    }


def write_json(path: Path, found: dict[str, Any]) -> None:
    """Writes a summary to a JSON file, and creates the file's folder if necessary."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(found, indent=1) + "\n")


def write_failures(path: Path, results: Sequence[SeedResult]) -> str:
    """Writes one image with the final pictures of at most `MAX_PICTURES` failed episodes.

    Deletes the file instead if there is no picture of a failed episode.

    Returns:
        A line of text with the file and the number of shown episodes. Empty without a picture.
    """
    all_failed = [each for each in sorted(results, key=lambda each: each.seed) if each.picture is not None]
    failed = all_failed[:MAX_PICTURES]
    if not failed:
        path.unlink(missing_ok=True)
        return ""
    width, height = PICTURE_PX
    sheet = Image.new("RGB", (width * min(COLUMNS, len(failed)), height * -(-len(failed) // COLUMNS)))
    draw = ImageDraw.Draw(sheet)
    for index, each in enumerate(failed):
        corner = (index % COLUMNS * width, index // COLUMNS * height)
        sheet.paste(Image.fromarray(each.picture).resize(PICTURE_PX), corner)
        draw.text((corner[0] + 6, corner[1] + 4), f"seed {each.seed}: {each.result.reason or 'failed'}", "red")
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.save(path)
    shown = f"{len(failed)}" if len(failed) == len(all_failed) else f"the first {len(failed)} of {len(all_failed)}"
    return f"ends of failed episodes, {shown}: {path}"
