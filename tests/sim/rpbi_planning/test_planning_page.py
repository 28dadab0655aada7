"""The page on planning: its Python example and its commands."""

from __future__ import annotations

import shlex

from page_blocks import blocks_of
from page_runs import run_blocks

from custom_ros_tools.console.command import Command
from rpbi_planning.console.plan import plan

(EXAMPLE,) = blocks_of("docs/planning.md", "python")
COMMANDS = [
    line
    for block in blocks_of("docs/planning.md", "shell")
    for line in block.text.splitlines()
    if line.startswith("./rpbi plan ")
]


def test_python_example_finds_a_motion(tmp_path):
    assert len([line for line in EXAMPLE.text.splitlines() if line.strip()]) <= 12
    (text,) = run_blocks([EXAMPLE], tmp_path)
    assert "waypoints" in text and "panda_joint1" in text


def test_commands_of_the_page_find_motions(tmp_path, monkeypatch, capsys):
    assert len(COMMANDS) == 2
    for line in COMMANDS:
        words = shlex.split(line)[2:]
        if "--out" in words:
            words[words.index("--out") + 1] = str(tmp_path / "motion.csv")
        assert not Command(plan).run(words)
    text = capsys.readouterr().out
    assert "foreseen: 0 contacts" in text and (tmp_path / "motion.csv").exists()
