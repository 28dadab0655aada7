"""Plans in simulated worlds: scenes of worlds, what is foreseen and what happens, and the command `plan`."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pybullet
import pytest

from custom_ros_tools.console.argument import UsageError
from custom_ros_tools.errors import ConfigError
from rpbi.world import World
from rpbi_planning import JointGoal, NamedGoal, PlanningScene, PoseGoal, plan
from rpbi_planning.console.plan import goal_of
from rpbi_planning.console.plan import plan as command
from rpbi_planning.foresee import execute
from rpbi_planning.group import Group

CONFIGS = Path(__file__).resolve().parents[3] / "src/rpbi_examples/configs"
PANDA, DUAL = (CONFIGS / f"basic_example_{name}/config.yaml" for name in ("panda", "dual_iiwa"))
ARM = [f"panda_joint{i}" for i in range(1, 8)]


@pytest.fixture
def world():
    made = World.from_file(str(PANDA), connection_mode=pybullet.DIRECT)
    yield made
    made.close()


def test_foreseen_state_is_reached(world):
    scene = PlanningScene.of_world(world)
    group = Group(scene, ["panda"], ARM)
    for number in range(2):
        scene.update(world)
        goal = JointGoal({"panda_joint1": 0.4 + 0.3 * number})
        result = plan(scene, "panda", goal, group=ARM, foresee=world, certify=False)
        assert result.success and result.foreseen is not None and result.trajectory is not None
        happened = execute(world, ["panda"], result.trajectory, group)
        assert result.foreseen.state_hash == happened.state_hash
        assert result.foreseen.contacts == happened.contacts == ()
        assert result.foreseen.joint_loads == happened.joint_loads
        assert happened.positions["panda/panda_joint1"] == pytest.approx(0.4 + 0.3 * number, abs=1e-2)


def test_foreseen_contact_is_reported(world):
    scene = PlanningScene.of_world(world)
    size = {"shapeType": "GEOM_BOX", "halfExtents": [0.02, 0.3, 0.5]}
    shape = {**size, "collisionFramePosition": [0.3, 0.45, 0.5]}
    wall = {"name": "wall", "createVisualShape": size, "createCollisionShape": shape}
    world.add("collision", {**wall, "object_tf": {"tf_id": "rpbi/floor"}})
    result = plan(scene, "panda", JointGoal({"panda_joint1": 1.2}), group=ARM, foresee=world, certify=False)
    assert result.foreseen is not None
    assert {second for _, _, second, _ in result.foreseen.contacts} == {"wall"}  # which the scene does not know


def test_two_arms_move_together():
    scene = PlanningScene.from_yaml(DUAL)
    goals = {name: JointGoal({"lbr_iiwa_joint_1": angle}) for name, angle in (("left", 1.0), ("right", -1.0))}
    result = plan(scene, ("left", "right"), goals, time_limit_s=60.0, shorten_s=0.1, certify=False)
    assert result.success, result.message
    assert len(result.joint_names) == 14 and result.joint_names[0].startswith("left/")
    assert result.path[-1][0] == pytest.approx(1.0)


def test_scene_follows_the_world(world):
    scene = PlanningScene.of_world(world)
    assert scene.names == ("panda", "floor") and len(scene.robots["panda"].positions) == 8
    version = scene.version
    world.put("panda/target", {"panda_joint1": 0.5})
    for _ in range(2000):
        world.step()
    scene.update(world)
    assert scene.robots["panda"].positions[0] == pytest.approx(0.5, abs=0.02)
    assert scene.version == version  # the collision model is kept
    world.remove("floor")
    scene.update(world)
    assert scene.names == ("panda",)


def test_world_without_robot_is_an_error(tmp_path):
    path = tmp_path / "empty.yaml"
    path.write_text("connect:\n  connection_mode: DIRECT\ntimeStep: 0.001\n")
    with pytest.raises(ConfigError, match="expected a world with a robot"):
        PlanningScene.from_yaml(path)


def test_command_prints_the_plan(capsys, tmp_path):
    out = tmp_path / "motion.csv"
    code = command(PANDA, "panda", to=["panda_joint1=30deg"], out=out, shorten=0.0)
    text = capsys.readouterr().out
    assert code == 0 and "panda_joint1 0.524" in text and "planning" in text
    rows = list(csv.reader(out.open()))
    assert rows[0][:2] == ["time", "position panda_joint1"]
    assert float(rows[-1][1]) == pytest.approx(np.radians(30.0))


def test_command_says_why_there_is_no_plan(capsys):
    assert command(PANDA, "panda", to=["panda_hand", "3", "0", "1"]) == 1
    assert "no plan: the goal cannot be reached" in capsys.readouterr().out


def test_words_of_the_command_are_goals():
    assert goal_of(["start"]) == NamedGoal("start")
    assert goal_of(["a=1", "b=2"]) == JointGoal({"a": 1.0, "b": 2.0})
    goal = goal_of(["hand", "0.1", "0.2", "0.3", "0", "0", "90deg"])
    assert isinstance(goal, PoseGoal) and goal.pose.quat_xyzw == pytest.approx((0.0, 0.0, 0.7071, 0.7071), abs=1e-4)
    for words in (["a", "b"], ["hand", "x", "0", "0"], ["a=x"]):
        with pytest.raises(UsageError, match="--to"):
            goal_of(words)
