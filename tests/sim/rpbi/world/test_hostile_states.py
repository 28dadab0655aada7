"""A sample of the hostile `.world` files that `dev/robustness/states.py` makes, and that it notices what goes wrong."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from worlds import FLOOR, box, write_world

ROOT = Path(__file__).resolve().parents[4]
sys.path.append(str(ROOT / "dev"))

from robustness import states  # noqa: E402
from robustness.hostile_bags.trial import tried  # noqa: E402
from rpbi.world import World  # noqa: E402
from rpbi.world.saved.command_log import RecordedCommand  # noqa: E402


@pytest.mark.parametrize("count", [4, pytest.param(12, marks=pytest.mark.thorough)])
def test_every_reader_takes_or_refuses_a_sample_of_hostile_states(count):
    command = [sys.executable, str(ROOT / "dev/robustness/states.py"), "--count", str(count), "--first", "5000"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-3000:]
    rows = [line.split(" | ") for line in done.stdout.splitlines() if line.startswith("| ")][1:]
    assert [row[0][2:] for row in rows] == [*states.READERS] and all(row[1] == str(count) for row in rows)
    assert all(int(row[3]) for row in rows), "some are refused"


def test_imports_and_writes_elsewhere_are_noticed(tmp_path):
    place = tmp_path / "folder/0"
    place.mkdir(parents=True)
    world = World.from_file(write_world(place, collision=(FLOOR,), dynamic=(box("box"),)))
    state = world.save()
    world.close()
    (place / "planted.py").write_text("class Thing: pass")
    hostile = state._replace(commands=(RecordedCommand(0, "box/pose", "input", '{"planted:Thing":[]}'),))
    hostile.write(place / "hostile.world")
    readers = {
        "refused": lambda path: World.from_state(path),
        "code": lambda path: World.from_state(path, trust=["planted"]),
    }
    for verdict, read in readers.items():
        trial = tried(states.watched(read), place / "hostile.world")
        assert trial.verdict == verdict, trial.said
    (place / "canary").unlink()
    writing = states.watched(lambda _: (tmp_path / "elsewhere").write_text(""))
    assert tried(writing, place / "hostile.world").verdict == "code"
