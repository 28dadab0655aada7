"""Options of the command `view` belong to the running world or to a recording."""

from __future__ import annotations

import contextlib
import io

import pytest

from custom_ros_tools.console.modules import command_of


def run(*words: str) -> tuple[int, str]:
    """Runs the command; returns its exit code and what it printed."""
    command = command_of("rpbi_data.console.view")
    assert command is not None
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(out):
        try:
            code = command.run(words)
        except SystemExit as ended:
            code = int(ended.code or 0)
    return code, out.getvalue()


@pytest.mark.parametrize("words", [("--out", "a.html"), ("--trust", "lab"), ("--any-size",), ("--max-cpu", "5")])
def test_options_of_recordings_need_a_recording(words: tuple[str, ...]) -> None:
    code, text = run(*words)
    assert code == 2 and "need a folder or a bag" in text


@pytest.mark.parametrize("words", [("--host", "0.0.0.0"), ("--port", "9000")])
def test_options_of_the_running_world_need_no_recording(words: tuple[str, ...]) -> None:
    code, text = run("some.bag", *words)
    assert code == 2 and "are for the running world" in text
