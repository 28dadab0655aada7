"""Episodes and data sets that several files of tests look at."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from pathlib import Path

import pytest
from written_episodes import CAMERA, write_episode

from custom_ros_tools.console.modules import command_of
from rpbi_data import EpisodeFolder

SIDE_CAMERA = "/rpbi/side/colour/image"
Run = Callable[..., tuple[int, str]]


def run_command(name: str, *words: str | Path) -> tuple[int, str]:
    """Runs a command; returns its exit code and what it printed."""
    command = command_of(f"rpbi_data.console.{name}")
    assert command is not None
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(out):
        code = command.run([str(word) for word in words])
    return code, out.getvalue()


@pytest.fixture(scope="session")
def run() -> Run:
    """Runs a command; returns its exit code and what it printed."""
    return run_command


@pytest.fixture(scope="session")
def demos(tmp_path_factory: pytest.TempPathFactory) -> EpisodeFolder:
    """Three episodes with two cameras; not to be changed."""
    folder = EpisodeFolder(tmp_path_factory.mktemp("written") / "demos")
    for number, label in enumerate(("success", "failure", "success")):
        write_episode(folder, label, phase=0.4 * number, seconds=1.2 + 0.2 * number, cameras=(CAMERA, SIDE_CAMERA))
    return folder


@pytest.fixture(scope="session")
def exported(demos: EpisodeFolder, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Returns the data set of a format, with all episodes; not to be changed."""
    made: dict[str, Path] = {}

    def export(name: str) -> Path:
        if name not in made:
            target = tmp_path_factory.mktemp("exported") / name
            code, text = run_command("export", demos.path, "--to", name, "--out", target, "--task", "push the box")
            assert code == 0, text
            made[name] = target
        return made[name]

    return export
