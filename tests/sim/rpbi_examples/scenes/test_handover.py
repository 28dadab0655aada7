"""A thing that slips or is held out too far makes an episode fail in one line; the person is that of other examples."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from scene_policies import act_at_random

from robot_model.geometry import Pose
from rpbi_examples.scenes import handover
from rpbi_examples.scenes.task import make_env, run_episode

ROBOTS = Path(__file__).parents[4] / "src/rpbi_examples/robots"


@pytest.fixture(scope="module")
def env():
    found = make_env("handover")
    yield found
    found.close()


def test_a_thing_without_friction_slips_off_the_palm(env, monkeypatch):
    monkeypatch.setattr(handover, "DYNAMICS", ((0.3, 0.0), (0.3, 0.001)))
    result = run_episode(env, 205)
    assert not result.success and result.reason == "the can has fallen"


@pytest.mark.thorough
def test_palm_beyond_reach_is_reported(env, monkeypatch):
    monkeypatch.setattr(handover, "PLACES_M", ((0.9, -0.2, 1.1), (0.9, -0.2, 1.1)))
    result = run_episode(env, 205)
    assert not result.success and result.reason.startswith("human: (") and "is out of reach" in result.reason


def test_policy_moves_only_the_robot_and_losing_the_object_ends(env):
    assert env.action_space.shape == (8,)
    *_, has_ended, _, _ = act_at_random(env, 30)
    scene = env.task.scene
    assert not has_ended and scene.seen.joints["human"]["jLeftShoulder_roty"] < -0.1, "the person raises an arm"
    env.world.act(scene.thing, "teleport", Pose((0.5, 0.5, 0.1)))
    ends = [env.step(env.action_space.sample())[2] for _ in range(10)]
    assert ends[-1] and not scene.has_succeeded()


def test_the_person_has_the_arms_of_the_other_examples():
    person, other = (ElementTree.parse(ROBOTS / f"{name}.urdf").getroot() for name in ("human_hands", "human_model"))
    moving = {joint.get("name"): joint for joint in person.findall("joint[@type='revolute']")}
    assert len(moving) == 13
    for name, joint in moving.items():
        same = other.find(f"joint[@name='{name}']")
        assert joint.find("axis").attrib == same.find("axis").attrib
        assert joint.find("limit").attrib == same.find("limit").attrib

    def mass(root):
        return sum(float(each.get("value")) for each in root.iter("mass"))

    assert mass(person) == pytest.approx(mass(other), abs=0.02)
