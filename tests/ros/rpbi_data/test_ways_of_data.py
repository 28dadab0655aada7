"""The files that data go through, as docs/architecture.md lists them."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path

import pytest
from written_episodes import CAMERA, write_episode

from custom_ros_tools.console.modules import command_of
from rpbi_data import EpisodeFolder
from rpbi_data.bags.bag_reader import BagMessage, BagReader

SRC = Path(__file__).resolve().parents[3] / "src"
PROGRAM = """
import json, sys

entered = set()

def note(frame, event, _):
    if event == "call":
        entered.add(frame.f_code.co_filename)

sys.setprofile(note)
{call}
sys.setprofile(None)
print()
print(json.dumps(sorted(entered)))
"""
TO_TABLE = "from rpbi_data import bag_to_dataframe; bag_to_dataframe(sys.argv[1])"
TO_LEROBOT = """
from custom_ros_tools.console.modules import command_of
assert command_of("rpbi_data.console.export").run([sys.argv[1], "--to", "lerobot", "--out", sys.argv[2]]) == 0
"""


@pytest.fixture(scope="module")
def demos(tmp_path_factory: pytest.TempPathFactory) -> EpisodeFolder:
    """An episode with a camera and a reset of its world."""
    folder = EpisodeFolder(tmp_path_factory.mktemp("written") / "demos")
    write_episode(folder, seconds=3.0, reset_s=0.4)
    return folder


def entered_files(call: str, *words: str | Path) -> list[Path]:
    """Returns the modules of the workspace that a program imports or calls, without `__init__.py`, below `src`."""
    command = [sys.executable, "-c", PROGRAM.format(call=call), *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    paths = [Path(each) for each in json.loads(done.stdout.splitlines()[-1])]
    return [path.relative_to(SRC) for path in paths if path.is_relative_to(SRC) and path.name != "__init__.py"]


def test_bag_becomes_a_table_within_one_folder(demos: EpisodeFolder) -> None:
    files = entered_files(TO_TABLE, demos.folder_of(0) / "episode.bag")
    data = [path for path in files if path.parts[0] != "custom_ros_tools"]
    assert {str(path.parent) for path in data} == {"rpbi_data/src/rpbi_data/bags"}
    assert len(data) <= 7, data


def test_episode_becomes_a_lerobot_data_set_within_one_package(demos: EpisodeFolder, tmp_path: Path) -> None:
    files = entered_files(TO_LEROBOT, demos.path, tmp_path / "set")
    assert {path.parts[0] for path in files} <= {"rpbi_data", "custom_ros_tools", "robot_model"}


def test_export_reads_each_message_once(demos: EpisodeFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Images up to the first one that is exported are read before, too, for its size."""
    read: Counter[str] = Counter()
    counts: dict[str, int] = {}
    original = BagReader.messages

    def messages(self: BagReader, topics: Collection[str]) -> Iterator[BagMessage]:
        counts.update(self.counts)
        for message in original(self, topics):
            read[message.topic] += 1
            yield message

    monkeypatch.setattr(BagReader, "messages", messages)
    command = command_of("rpbi_data.console.export")
    assert command is not None
    assert command.run([str(demos.path), "--to", "lerobot", "--out", str(tmp_path / "set")]) == 0
    assert counts[CAMERA] <= read.pop(CAMERA) < 2 * counts[CAMERA]
    assert read and read == {topic: counts[topic] for topic in read}
