"""The commands of the pages run, in the order of their page, and print the shown output.

These are the blocks without a mark, or with the mark `in COMMAND`; see `page_blocks`.
"""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from page_blocks import COMMANDS, ROOT, Block, all_blocks
from page_runs import agree, write_files
from ros_system import RPBI, RosSystem, stop_group, wait_until

from ros_pybullet_interface.msg import SimulationState

BLOCKS = [
    block for block in all_blocks() if block.language in COMMANDS and not block.marks.keys() & {"not run", "run by"}
]
PAGES = sorted({block.page for block in BLOCKS})
ENDLESS = re.compile(r"rostopic (echo (?!.*-n)|pub -r|hz)|rosbag record|rosrun (topic_tools throttle|custom_ros_tools)")
"""Commands that run until Ctrl-C."""
ENDLESS_S = 10.0
SHORTER = {
    r"--seeds [\d-]+( \d+)*": "--seeds 1",
    r"--count \d+": "--count 2",
    r"--targets \d{2,}": "--targets 200",
    r"--states \d+": "--states 5",
    r"--climbs \d+": "--climbs 1",
}
"""Smaller options for commands that take minutes, indexed by pattern."""
STARTED_ELSEWHERE = (ROOT / "tests/ros/rpbi_examples/test_launch_starts.py").read_text()
TICKS = 20
SLOW_S = 120.0


class Terminal:
    """A folder in which the commands of a page run, and the world that runs meanwhile.

    Args:
        ros: Nodes of the test.
        page: File of the page.
    """

    def __init__(self, ros: RosSystem, page: str) -> None:
        self._ros = ros
        self._folder = ros.folder
        self._launched: subprocess.Popen | None = None
        for path, target in (("rpbi", "rpbi"), (".venv", ".venv"), ("dev", "dev")):
            (self._folder / path).symlink_to(ROOT / target)
        write_files("docs/worlds.md", self._folder)
        (self._folder / "WORLD.yaml").write_text((self._folder / "world.yaml").read_text())
        write_files(page, self._folder)

    def run(self, block: Block) -> None:
        """Runs the commands of a block."""
        world = block.marks.get("in")
        if world:
            self.launch(shlex.split(world)[2:])
        for command, shown in block.commands:
            words = shlex.split(command, comments=True)
            if words[1:2] == ["setup"]:  # installs packages
                continue
            for pattern, option in SHORTER.items() if "shorter" in block.marks else ():
                command = re.sub(pattern, option, command)
            if words[1:2] == ["launch"] and len(words) > 2:
                self.launch(words[2:])
                continue
            printed = self._printed(command)
            assert "success: False" not in printed, f"{block}: {command}\n{printed}"
            assert not shown or agree(shown, printed, "output varies" in block.marks), (
                f"{block} shows {shown}\n{printed}"
            )
        self.stop()

    def launch(self, words: list[str]) -> None:
        """Launches an example or a world, in place of the one that runs, and waits until it ticks."""
        self.stop()
        if "headless:=true" not in words:
            words = [*words, "headless:=true"]
        if words[0].endswith(".yaml"):
            words = [str(self._folder / words[0]), *words[1:]]
        states = self._ros.listen("/rpbi/state", SimulationState)
        launched = self._ros.start([RPBI, "launch", *words])
        self._launched = launched
        wait_until(
            lambda: launched.poll() is not None or (states.messages and states.messages[-1].tick > TICKS),
            f"{words} ticks",
            SLOW_S,
        )
        output = self._ros.output(launched)
        assert launched.poll() is None and not re.search("FATAL|ERROR|Traceback|has died", output), output

    def stop(self) -> None:
        """Ends the world that runs, as Ctrl-C does."""
        if self._launched is not None:
            stop_group(self._launched)
            self._launched = None

    def _printed(self, command: str) -> str:
        """Runs a command, and returns its standard output."""
        process = subprocess.Popen(
            ["bash", "-c", command],
            cwd=self._folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        try:
            printed, errors = process.communicate(timeout=ENDLESS_S if ENDLESS.match(command) else SLOW_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGINT)
            printed, errors = process.communicate(timeout=SLOW_S)
            assert ENDLESS.match(command) and "Traceback" not in errors, f"{command}\n{printed}{errors}"
        else:
            assert process.returncode == 0, f"{command}\n{printed}{errors}"
        return printed


def is_started_elsewhere(block: Block) -> bool:
    """Whether a block only launches examples without arguments, which another test starts."""
    lines = [shlex.split(command, comments=True) for command, _ in block.commands]
    return all(len(words) == 3 and f'"{words[2]}": [],' in STARTED_ELSEWHERE for words in lines)


@pytest.fixture
def home() -> Iterator[None]:
    """The checkout in the home folder, where pages have it."""
    link = Path.home() / "rpbi"
    link.symlink_to(ROOT)
    yield
    link.unlink()


@pytest.mark.thorough
@pytest.mark.timeout(1800)
@pytest.mark.usefixtures("home")
@pytest.mark.parametrize("page", PAGES)
def test_commands_of_the_page_print_the_shown_output(ros: RosSystem, page: str) -> None:
    terminal = Terminal(ros, page)
    for block in BLOCKS:
        if block.page == page and not is_started_elsewhere(block):
            terminal.run(block)


@pytest.mark.usefixtures("home")
@pytest.mark.parametrize(
    "text",
    [
        "$ echo 12 states\n13 states\n",
        "$ ls lost_file\n",
        "$ printf 'success: False'\n",
        "$ rostopic echo -n 1 /lost_topic_of_no_world/lost --lost-option\n",
    ],
)
def test_command_that_fails_or_prints_something_else_is_named(ros: RosSystem, text: str) -> None:
    with pytest.raises(AssertionError, match="echo 12|13 states|lost|success: False"):
        Terminal(ros, "docs/index.md").run(Block("a.md", 1, "console", text))
