"""Completion in bash, driven as a user does: an interactive bash in a terminal, letters and tabs."""

from __future__ import annotations

import os
import pty
import re
import select
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROMPT = "ready> "
INPUTRC = "set enable-bracketed-paste off\nset show-all-if-ambiguous on\nset page-completions off\nset bell-style none\n"


class Terminal:
    """An interactive bash that has sourced the completion; `folder` is where it is."""

    def __init__(self, folder: Path) -> None:
        (folder / "inputrc").write_text(INPUTRC)
        environment = {"PATH": "/usr/bin:/bin", "TERM": "dumb", "HOME": str(folder), "PS1": PROMPT, "COLUMNS": "1000",
                       "INPUTRC": str(folder / "inputrc")}  # fmt: skip
        self._us, them = pty.openpty()
        self._bash = subprocess.Popen(
            ["bash", "--norc", "-i"], cwd=folder, env=environment, stdin=them, stdout=them, stderr=them,
            start_new_session=True,
        )  # fmt: skip
        os.close(them)
        self.read_until(PROMPT)
        self.send(f"source {ROOT}/tools/completion.bash; ln -sf {ROOT}/rpbi rpbi\n")
        self.read_until(f"\n{PROMPT}")

    def send(self, text: str) -> None:
        os.write(self._us, text.encode())

    def read_until(self, end: str) -> str:
        """Returns what bash writes up to some text."""
        seen = ""
        give_up_s = time.monotonic() + 60.0
        while not seen.endswith(end):
            ready, _, _ = select.select([self._us], [], [], max(0.0, give_up_s - time.monotonic()))
            assert ready, f"expected {end!r} at the end of {seen!r}"
            seen += os.read(self._us, 4096).decode().replace("\r", "")
        return seen

    def completed(self, line: str) -> str:
        """Types a line that ends with a tab, and returns the line that bash makes of it."""
        self.send(f"{line}\x01echo \x05;\n")  # to the line's start, and to its end
        seen = self.read_until(f"\n{PROMPT}")
        return seen.splitlines()[-2]

    def offered(self, line: str) -> set[str]:
        """Types a line that ends with a tab, and returns what bash offers."""
        self.send(f"{line}\x15\n")  # the line is dropped
        seen = self.read_until(f"{PROMPT}")
        while seen.count(PROMPT) < 2:  # below the offer, and below the dropped line
            seen += self.read_until(PROMPT)
        return set(seen.partition("\n")[2].partition(PROMPT)[0].split())

    def close(self) -> None:
        self.send("exit\n")
        self._bash.wait(30.0)
        os.close(self._us)


@pytest.fixture(scope="module")
def terminal(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Terminal]:
    folder = tmp_path_factory.mktemp("completion")
    (folder / "my worlds").mkdir()
    (folder / "my worlds" / "lab.yaml").touch()
    (folder / "notes.txt").touch()
    (folder / "run.bag").touch()
    terminal = Terminal(folder)
    yield terminal
    terminal.close()


@pytest.mark.parametrize(
    ("typed", "line"),
    [
        ("./rpbi la\t", "./rpbi launch"),
        (f"{ROOT}/rpbi che\t", f"{ROOT}/rpbi check"),
        ("./rpbi launch gras\t", "./rpbi launch grasp_example"),
        ("./rpbi launch grasp_example real\t0", "./rpbi launch grasp_example real_time_factor:=0"),
        ("./rpbi launch grasp_example gui:=true headl\ttrue", "./rpbi launch grasp_example gui:=true headless:=true"),
        ("./rpbi demo --head\t", "./rpbi demo --headless"),
        ("./rpbi demo --headless --sec\t", "./rpbi demo --headless --seconds"),
        ("./rpbi check my\tl\t", "./rpbi check my worlds/lab.yaml"),
        ("./rpbi replay r\t", "./rpbi replay run.bag"),
        ("./rpbi spawn --type vi\t", "./rpbi spawn --type visual"),
        ("./rpbi setup as\t", "./rpbi setup assets"),
        ("./rpbi bench gra\t", "./rpbi bench grasp"),
        ("./rpbi launch nothing_of_this\t", "./rpbi launch nothing_of_this"),
    ],
)
def test_a_tab_completes(terminal, typed, line):
    assert terminal.completed(typed) == line


def test_a_tab_offers_all_commands(terminal):
    usage = subprocess.run([ROOT / "rpbi"], capture_output=True, text=True).stdout
    assert terminal.offered("./rpbi \t") == set(re.findall(r"^  (\w+) ", usage, re.MULTILINE))


def test_arguments_of_a_launch_file_are_offered(terminal):
    expected = {"drag:=", "gui:=", "headless:=", "ik:=", "ik_hz:=", "real_time_factor:=", "rviz:=", "use_sim_time:="}
    assert terminal.offered("./rpbi launch kuka_lwr_ik_example \t") == expected


def test_other_files_are_not_offered(terminal):
    assert terminal.offered("./rpbi replay \t") == {"my", "worlds/", "run.bag"}
