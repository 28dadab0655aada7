"""Commands of the console are made of functions: parser, exit codes, help and completion."""

from __future__ import annotations

import signal
import subprocess
import sys
from typing import Annotated

import pytest

from custom_ros_tools.console.argument import Argument, UsageError, number
from custom_ros_tools.console.command import Command
from custom_ros_tools.errors import InterfaceError

Switch = Annotated[bool, Argument("", excludes="one")]


def push(
    name: Annotated[str, Argument("NAME")],
    *targets: Annotated[float, Argument("[TARGET ...]", parse=number, files="*.yaml")],
    force: Annotated[list[float] | None, Argument("X Y Z", "--by", number)] = None,
    hard: Switch = False,
    soft: Switch = False,
) -> str:
    """Pushes something.

    Text of its own.

    Args:
        NAME: what is pushed
        force: force [N], by default
            none
        hard: with all its might
    """
    if name == "wall":
        raise InterfaceError("the wall stays")
    if soft and force:
        raise UsageError("--soft has no force")
    return f"{name} {targets} {force} {hard} {soft}"


def echo(*words: Annotated[str, Argument("[WORD ...]", is_raw=True)]) -> int:
    """Prints its words."""
    print(*words)
    return len(words)


@pytest.mark.parametrize(
    ("line", "printed"),
    [
        ("box", "box () None False False\n"),
        ("box -90deg 1e0 __name:=x --hard", "box (-1.5707963267948966, 1.0) None True False\n"),
        ("box --by -1 .5 -2e1", "box () [-1.0, 0.5, -20.0] False False\n"),
    ],
)
def test_words_become_arguments(capsys, line, printed):
    assert Command(push).run(line.split()) == 0
    assert capsys.readouterr().out == printed


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("box --soft --by 1 2 3", "./rpbi push: error: --soft has no force\n"),
        ("box --soft --hard", "./rpbi push: error: argument --hard: not allowed with argument --soft\n"),
        ("box --by 1 2", "./rpbi push: error: argument --by: expected 3 arguments\n"),
        ("box much", "./rpbi push: error: argument TARGET: invalid number value: 'much'\n"),
    ],
)
def test_wrong_words_end_with_2_after_the_usage(capsys, line, message):
    with pytest.raises(SystemExit) as end:
        Command(push).run(line.split())
    assert end.value.code == 2
    assert capsys.readouterr().err.endswith(message)


def test_error_is_one_line_with_the_name_of_the_command(capsys):
    assert Command(push).run(["wall"]) == 1
    assert capsys.readouterr().err == "push: the wall stays\n"


def test_raw_arguments_are_passed_and_integers_become_the_exit_code(capsys):
    assert Command(echo).run(["-x", "__name:=y", "--zed=1"]) == 3
    assert capsys.readouterr().out == "-x __name:=y --zed=1\n"


def test_help_and_completion_follow_from_the_function(capsys):
    section = """\
    ./rpbi push NAME [TARGET ...] [--by X Y Z] [--hard] [--soft]

Pushes something.

    NAME             what is pushed
    --by X Y Z       force [N], by default
                     none
    --hard           with all its might

Text of its own.
"""
    assert Command(push).section == section
    assert Command(push).run(["box", "--help"]) == 0
    assert capsys.readouterr().out == section
    assert list(Command(push).completions()) == ["push * files *.yaml"]


def test_a_parameter_without_an_argument_is_named():
    def wave(hand: str) -> None:
        """Waves."""

    with pytest.raises(TypeError, match="wave: hand: expected Annotated"):
        _ = Command(wave).parameters


def test_texts_are_safe_for_a_terminal(capsys):
    odd = "\x1b[2J\x07\u202e"
    assert Command(push).run([odd]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith(r"\x1b[2J\x07\u202e ()")


PROGRAM = """
import sys
from custom_ros_tools.console.command import Command
from custom_ros_tools.program import run_command

def episodes():
    sys.stdin.read()
    if not LINES:
        return "one line"
    for _ in range(LINES):
        print("x" * 100)

run_command("builtins:print", lambda _: Command(episodes).run([]))
"""


@pytest.mark.parametrize("lines", [0, 10_000])
def test_a_command_whose_output_is_closed_ends_quietly(lines):
    """As `./rpbi episodes DIR | head` does; it ends as by SIGPIPE."""
    program = PROGRAM.replace("LINES", str(lines))
    with subprocess.Popen([sys.executable, "-c", program], stdin=-1, stdout=-1, stderr=-1) as process:
        process.stdout.close()
        process.stdin.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141


IMPORTS = """
import os, signal
from custom_ros_tools.program import late_imports, run_command

def library():
    try:  # as trimesh does
        os.kill(os.getpid(), signal.SIGINT)
    except BaseException as error:
        print("swallowed")

def command():
    WITH
        library()
    print("goes on")

run_command("builtins:print", lambda _: command())
"""


@pytest.mark.parametrize("block", ["with late_imports():", "if True:"])
def test_ctrl_c_ends_a_command_despite_imports_that_swallow_it(block):
    command = [sys.executable, "-c", IMPORTS.replace("WITH", block)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0)
    if "late" in block:
        assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")
    else:
        assert done.stdout == "swallowed\ngoes on\n"
