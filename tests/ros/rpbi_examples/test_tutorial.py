"""docs/tutorial.md, from its first line to its last, as a newcomer follows it."""

from __future__ import annotations

import re
import subprocess
from functools import partial
from pathlib import Path

import pandas as pd
import pytest
from node_world import objects
from PIL import Image
from ros_system import RosSystem, wait_until

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs/tutorial.md").read_text()
FILES = {name: text for text, name in re.findall(r"```(?:yaml|python)\n(# (\S+).*?)```", PAGE, flags=re.DOTALL)}
"""The files on the page, by the names in their first lines."""
COMMANDS = [
    line.replace("~/rpbi", str(ROOT))
    for block in re.findall(r"```shell\n(~/rpbi.*?)```", PAGE, flags=re.DOTALL)
    for line in block.splitlines()
]
LAUNCH = " launch "


def _has_ended_or_answers(launched: subprocess.Popen, system: RosSystem) -> bool:
    return launched.poll() is not None or bool(objects(system))


@pytest.fixture(scope="module")
def followed(ros_master, tmp_path_factory):
    """The folder after all commands of the page, twice as fast as there; and what each command printed."""
    folder = tmp_path_factory.mktemp("lab")
    for name, text in FILES.items():
        (folder / name).write_text(text)
    printed = {}
    system = RosSystem(folder)
    try:
        for command in COMMANDS:
            if LAUNCH in command:
                launched = system.start(["bash", "-c", f"cd {folder} && exec {command} real_time_factor:=2"])
                wait_until(partial(_has_ended_or_answers, launched, system), "the world runs")
                assert launched.poll() is None, system.output(launched)
                continue
            done = subprocess.run(["bash", "-c", command], cwd=folder, capture_output=True, text=True, timeout=120.0)
            assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
            printed[command.removeprefix(f"{ROOT}/rpbi ")] = done.stdout
        yield folder, printed
    finally:
        system.close()


def test_the_page_has_all_that_it_takes():
    yamls = {f"{name}.yaml" for name in ("world", "floor", "table", "box", "ball", "panda")}
    assert set(FILES) == {*yamls, "look.py", "lift.py", "path.py"}
    assert sum(LAUNCH in command for command in COMMANDS) == 1


@pytest.mark.thorough
def test_world_passes_the_check_and_has_the_pages_objects(followed):
    _, printed = followed
    assert "world.yaml: fine; 1000 ticks a second" in printed["check world.yaml"]
    names = {"floor", "table", "box", "blue_box", "ball", "panda", "camera"}
    assert {line.split()[0] for line in printed["list"].splitlines()} == names
    (ball,) = (text for command, text in printed.items() if "ball/base_state" in command)
    position = {axis: float(value) for axis, value in re.findall(r"(\w): (\S+)", ball)}
    assert position == pytest.approx({"x": 0.5, "y": 0.25, "z": 0.24}, abs=0.002)


@pytest.mark.thorough
def test_the_camera_sees_the_boxes_and_the_ball(followed):
    folder, _ = followed
    with Image.open(folder / "colour.png") as image:
        pixels = list(image.convert("RGB").getdata())
    assert sum(r > 150 and g < 0.8 * r and b < 0.3 * r for r, g, b in pixels) > 100, "orange"
    assert sum(b > 100 and b > 1.5 * r for r, g, b in pixels) > 100, "blue"
    assert sum(g > 100 and g > 1.5 * r and g > 1.5 * b for r, g, b in pixels) > 200, "green"
    with Image.open(folder / "depth.png") as image:
        assert len(set(image.convert("RGB").getdata())) > 50


@pytest.mark.thorough
def test_path_of_the_lifted_box_is_a_table_and_plot(followed):
    folder, _ = followed
    path = pd.read_csv(folder / "path.csv", index_col="time")
    assert list(path.columns) == ["x", "y", "z"]
    assert len(path) > 500
    assert path.iloc[0].tolist() == pytest.approx([0.5, 0.0, 0.225], abs=0.001)
    assert path.iloc[-1].tolist() == pytest.approx([0.5, 0.1, 0.475], abs=0.002)
    with Image.open(folder / "path.png") as image:
        assert image.size == (1600, 800)
