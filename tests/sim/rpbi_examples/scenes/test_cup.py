"""A ball beside the cup, or a cup without friction, is no success; one that succeeds is tested with the launch file."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, parse

import pytest

from custom_ros_tools.errors import ConfigError
from robot_model.asset_files import find_file
from robot_model.geometry import Pose
from rpbi_examples.scenes import cup
from rpbi_examples.scenes.scene import Scene
from rpbi_examples.scenes.task import make_env, run_episode

ORIGINAL = "{example-robot-data}/robots/kinova_description/robots/kinova.urdf"


@pytest.fixture(scope="module")
def env():
    found = make_env("cup")
    yield found
    found.close()


def test_a_ball_that_leaves_the_cup_is_a_fault(env):
    env.reset(seed=203)
    for _ in range(50):
        env.step(None)
    scene = env.task.scene
    assert scene.figures()["balls inside"] == 5 and not scene.fault(), "they have come to rest in it"
    env.world.act("ball_3", "teleport", Pose((0.5, 0.0, 0.6)))
    env.step(None)
    assert scene.figures()["balls inside"] == 4 and not scene.has_succeeded()
    assert scene.fault() == "1 of 5 balls spilled"


def test_a_slippery_cup_stays_on_the_table(env, monkeypatch):
    monkeypatch.setattr(cup.Cup, "change", lambda self, target, **_: Scene.change(self, target, lateralFriction=0.05))
    result = run_episode(env, 203)
    assert not result.success and result.reason == "kinova: expected the cup to rise by 50 mm, got 0 mm"
    assert result.figures["balls inside"] == 5


def test_arm_equals_that_of_the_extra_except_for_fingers():
    original, ours = (joints_of(name) for name in (ORIGINAL, "{rpbi_examples}/robots/kinova_hand.urdf"))
    assert original.keys() == ours.keys()
    for name, joint in ours.items():
        assert origin_of(joint) == pytest.approx(origin_of(original[name]), abs=1e-9)
        assert original[name].get("type") == ("fixed" if "finger" in name else joint.get("type"))
        if joint.get("type") != "fixed":
            assert speed_of(joint) == speed_of(original[name])


def test_missing_extra_is_reported_with_its_install_command(monkeypatch):
    def fail() -> Path:
        raise ValueError("'example-robot-data' is not installed: ./rpbi setup assets")

    monkeypatch.setattr("robot_model.asset_files._assets", fail)
    with pytest.raises(ConfigError, match="^[^\n]*'example-robot-data' is not installed: ./rpbi setup assets$"):
        make_env("cup")


def joints_of(urdf: str) -> dict[str, Element]:
    """Returns the joints of a URDF by name."""
    return {joint.get("name", ""): joint for joint in parse(find_file(urdf, "~")).getroot().iterfind("joint")}


def origin_of(joint: Element) -> list[float]:
    """Returns the position [m] and the turn [rad] of a joint's origin."""
    origin = joint.find("origin")
    assert origin is not None
    return [float(word) for key in ("xyz", "rpy") for word in origin.get(key, "0 0 0").split()]


def speed_of(joint: Element) -> float:
    """Returns the largest speed of a joint [rad/s]."""
    limit = joint.find("limit")
    assert limit is not None
    return float(limit.get("velocity", "nan"))
