"""Worlds without ROS, as pages and the README show them, run with the Python of .venv, nothing sourced."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
import yaml
from page_blocks import blocks_of
from page_runs import run_blocks

ROOT = Path(__file__).resolve().parents[4]
PYTHON = ROOT / ".venv/bin/python"
VARIATION = ROOT / "src/rpbi_examples/configs/gym/push/random.yaml"


def run(script: str, folder: Path, python: Path = PYTHON) -> subprocess.CompletedProcess:
    """Runs a script in a folder and an environment that know nothing of the workspace."""
    (folder / "script.py").write_text(script)
    clean = ["env", "-i", "PATH=/usr/local/bin:/usr/bin:/bin", f"HOME={folder}", str(python), "script.py"]
    return subprocess.run(clean, cwd=folder, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> list[str]:
    """Texts that the blocks of the page print, a part for each block."""
    blocks = [block for block in blocks_of("docs/python.md", "python") if Path(__file__).name in block.mark]
    parts = run_blocks(blocks, tmp_path_factory.mktemp("page"))
    assert len(parts) == 11
    return parts


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", text)]


def test_world_lists_its_bodies(page):
    assert page[0].splitlines()[-2:] == ["['work_area', 'floor', 'box', 'kuka_lwr']", "0 0.0 0.001"]


def test_samples_come_at_their_rates(page):
    states, weight = page[1].splitlines()
    assert numbers(states) == pytest.approx([100, 0.5236], abs=2e-3)
    assert float(weight) == pytest.approx(0.8 * 9.81, rel=0.01)


def test_inputs_are_those_that_the_page_lists(page):
    slots = re.findall(r"'([\w/]+)'", page[3])
    assert slots[:4] == ["work_area/pose", "floor/pose", "box/external_wrench", "kuka_lwr/external_wrench"]
    assert {"kuka_lwr/target", "camera/pose"} <= set(slots)


def test_a_misspelt_joint_is_named(page):
    assert page[4].startswith("unknown joint 'lwr_arm_9_joint': known are base_joint, lwr_arm_0_joint")


def test_a_motion_ends_where_it_was_to(page):
    assert page[5].startswith("MotionResult(success=True, message=")


def test_a_ball_comes_and_goes(page):
    assert float(page[6]) == pytest.approx(0.05, abs=2e-3)


def test_images_are_arrays_that_show_the_box(page):
    colour, depth, box, *_ = page[7].splitlines()
    assert (colour, depth) == ("(480, 640, 3) uint8", "(480, 640) float32")
    pixels, distance_m = numbers(box)
    assert pixels > 500 and 2.0 < distance_m < 4.0


def test_a_reset_is_exact(page):
    assert page[8] == "True True 100\n"


def test_worlds_of_one_process_do_not_meet(page):
    assert page[9] == "[0.0, 0.2, 0.4]\n"


def test_the_environment_for_learning_runs(page):
    assert 0.0 < float(page[10]) < 2.0


def test_all_actions_are_on_the_page():
    from rpbi.world.actions import ACTIONS

    section = (ROOT / "docs/python.md").read_text().split("## Actions")[1].split("## ")[0]
    rows = [row for row in section.splitlines() if row.startswith("| `")]
    told = {name for row in rows for name in re.findall(r"`(\w+)`", row.split("|")[1])}
    assert told == ACTIONS.keys() - {"set_controller_gains"}, "that one takes a configuration, see controllers.md"


def test_the_block_of_the_readme_runs(tmp_path):
    (block,) = blocks_of("README.md", "python")
    run_blocks([block._replace(text=f"{block.text}\nassert len(samples) > 100")], tmp_path)


def test_another_python_does_not_find_the_packages(tmp_path):
    result = run("import rpbi.world", tmp_path, Path("/usr/bin/python3"))
    assert "No module named 'rpbi'" in result.stderr, "else the tests above show nothing"


def test_the_page_on_speed_times_a_tick(tmp_path):
    (printed,) = run_blocks(blocks_of("docs/slow.md", "python"), tmp_path)
    assert re.fullmatch(r"\d+ us a tick of 1000 us\n", printed)


def test_page_on_many_worlds_shows_true_output(tmp_path):
    blocks = [block for block in blocks_of("docs/replay_and_fork.md", "python") if "rospy" not in block.text]
    assert len(blocks) == 5
    _, _, forks, *_ = run_blocks(blocks, tmp_path)
    assert len(set(forks.split())) == 2, "the forks differ"


def test_page_on_environments_shows_true_output(tmp_path):
    first, _, _, own, varied, _, _ = run_blocks(blocks_of("docs/gym.md", "python"), tmp_path)
    assert first.startswith("['box/pose', 'goal', 'hand', 'kuka_lwr/joints'] False\n(")
    assert own.startswith("Box(-1.0, 1.0, (7,), float32) Box(0.0, 2.0, (1,), float32) [0.15")
    masses = numbers(varied)
    assert len({*masses, 0.8}) == 3 and all(0.7 * 0.8 <= mass <= 1.3 * 0.8 for mass in masses)


def test_random_variation_on_the_page_equals_that_of_the_example():
    (block,) = blocks_of("docs/gym.md", "yaml")
    assert yaml.safe_load(block.text) == yaml.safe_load(VARIATION.read_text())
