"""Too little force or too wide lanes make an episode fail; a board that is wiped is tested with the launch file."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from scene_policies import act_at_random

from rpbi_examples.scenes import wiping
from rpbi_examples.scenes.task import make_env, run_episode
from rpbi_examples.scenes.wiping_plot import draw

ROBOTS = Path(__file__).parents[4] / "src/rpbi_examples/robots"


@pytest.fixture(scope="module")
def env():
    found = make_env("wiping")
    yield found
    found.close()


@pytest.mark.thorough
def test_lanes_that_are_too_wide_leave_stains_which_are_drawn(env, tmp_path, monkeypatch):
    monkeypatch.setattr(wiping, "LANES", 1)
    result = run_episode(env, 203)
    assert not result.success and not result.reason
    assert result.figures["way within 10 % [%]"] > 95.0 and 20.0 < result.figures["stains gone [%]"] < 60.0
    left = {name for name in env.world.bodies if name.startswith("stain")}
    scene = env.task.scene
    assert left == set(scene.left) and len(scene.stains) == 80
    draw(scene, result, "wiping", tmp_path / "plot.png")
    assert (tmp_path / "plot.png").stat().st_size > 10_000


def test_another_force_than_that_asked_for_fails_in_one_line(env, monkeypatch):
    monkeypatch.setattr(wiping.Wiping, "tune", lambda *_, **__: None)  # the controller keeps its 10 N, straight down
    result = run_episode(env, 203)
    assert not result.success and result.reason.startswith("expected to press with 22.8 N, got ")
    assert result.figures["stains gone [%]"] == 0.0


def test_policy_wipes_along_the_path_of_the_pressed_sponge(env):
    observation, *_ = act_at_random(env, 3)
    scene = env.task.scene
    assert env.action_space.shape == (6,) and list(observation["goal"]) == pytest.approx([scene.force])
    assert not scene.stamps, "the arm is on its way to the board"
    for _ in range(300):
        env.step([0.0, 0.2, 0.0, 0.0, 0.0, 0.0])
        if len(scene.stamps) >= 50:
            break
    assert scene.stamps[-1].y - scene.stamps[0].y == pytest.approx(0.05, abs=0.02)


def test_arm_equals_that_of_the_other_examples():
    arm, other = (ElementTree.parse(ROBOTS / f"{name}.urdf").getroot() for name in ("kuka_lwr_sponge", "kuka_lwr"))
    for root, tools in ((arm, ["sponge"]), (other, ["sponge", "ball"])):
        for tool in tools:
            for part in root.findall(f"link[@name='end_effector_{tool}']"):
                root.remove(part)
    for joint in other.findall("joint[@name='end_effector_ball']"):
        other.remove(joint)
    texts = [ElementTree.canonicalize(ElementTree.tostring(root, "unicode"), strip_text=True) for root in (arm, other)]
    assert texts[0] == texts[1]
