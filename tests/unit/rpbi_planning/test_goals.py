"""Goals and constraints from mappings, and the planning scene's bodies."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from custom_ros_tools.errors import UnknownNameError
from robot_model.collision.shapes import Obstacle
from robot_model.geometry import Pose
from rpbi_planning import JointGoal, NamedGoal, PlanningScene, PoseGoal, RegionGoal, Upright, constraint_from, goal_from

LWR = Path(__file__).resolve().parents[3] / "src/rpbi_examples/robots/kuka_lwr.urdf"
BOX = Obstacle("box", "box", (0.1, 0.1, 0.1), Pose((0.5, 0.0, 0.5)))


@pytest.fixture
def scene() -> PlanningScene:
    made = PlanningScene()
    made.add_robot("arm", str(LWR))
    made.add(BOX)
    return made


@pytest.mark.parametrize(
    ("data", "goal"),
    [
        ({"type": "joints", "positions": {"a": 1}}, JointGoal({"a": 1.0})),
        ({"type": "joints", "positions": [0, 1]}, JointGoal((0.0, 1.0))),
        ({"type": "named", "name": "start"}, NamedGoal("start")),
        ({"type": "pose", "link": "hand", "pose": {"position": [1, 2, 3]}}, PoseGoal("hand", Pose((1.0, 2.0, 3.0)))),
        (
            {"type": "region", "link": "hand", "pose": {"position": [0, 0, 1]}, "size": [1, 1, 1]},
            RegionGoal("hand", Pose((0.0, 0.0, 1.0)), (1.0, 1.0, 1.0)),
        ),
    ],
)
def test_mapping_becomes_a_goal(data, goal):
    assert goal_from(data) == goal


def test_mapping_becomes_a_constraint():
    assert constraint_from({"type": "upright", "link": "cup", "axis": [0, 0, 2]}) == Upright("cup")


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"type": "joint"}, "did you mean|expected one of"),
        ({"type": "pose", "link": "hand"}, "pose: expected a value"),
        ({"type": "pose", "link": "hand", "pose": {"position": [1, 2]}}, "expected 3 numbers"),
        ({"type": "pose", "link": "hand", "pose": [1, 2, 3]}, "expected a mapping"),
        ({"type": "named", "name": "x", "nam": 1}, "unknown key 'nam'"),
        ({"type": "joints", "positions": {"a": "b"}}, "expected a number"),
        ([], "expected a mapping"),
    ],
)
def test_invalid_mapping_is_an_error(data, words):
    with pytest.raises(ValueError, match=words):
        goal_from(data)


@pytest.mark.parametrize("options", [{"tolerance": 0.0}, {"axis": (0.0, 0.0, 0.0)}, {"tolerance": math.nan}])
def test_invalid_constraint_is_an_error(options):
    with pytest.raises(ValueError, match="expected"):
        Upright("cup", **options)


def test_attached_body_moves_with_the_link(scene):
    before = scene.body_pose("box")
    scene.attach("box", "arm", "end_effector_ball")
    with pytest.raises(ValueError, match="holds this body"):
        scene.place("box", Pose())
    scene.set_positions("arm", {"lwr_arm_0_joint": 1.0})
    assert math.dist(scene.body_pose("box").position, before.position) > 0.1
    scene.detach("box")
    scene.set_positions("arm", {"lwr_arm_0_joint": 0.0})
    assert math.dist(scene.body_pose("box").position, before.position) > 0.1


def test_unknown_names_are_errors(scene):
    for call in (lambda: scene.remove("x"), lambda: scene.place("x", Pose()), lambda: scene.detach("box"),
                 lambda: scene.attach("x", "arm", "end_effector_ball"),
                 lambda: scene.attach("box", "arm", "x")):  # fmt: skip
        with pytest.raises(UnknownNameError):
            call()


@pytest.mark.parametrize(
    "shape",
    [
        BOX._replace(size=(math.nan, 1.0, 1.0)),
        BOX._replace(size=(-1.0, 1.0, 1.0)),
        BOX._replace(pose=Pose((math.inf, 0.0, 0.0))),
        BOX._replace(name="arm"),
    ],
)
def test_invalid_body_is_refused(scene, shape):
    names = scene.names
    with pytest.raises(ValueError):
        scene.add(shape)
    assert scene.names == names


def test_obstacles_are_in_the_frame_of_the_robot(scene):
    scene.place("arm", Pose((1.0, 0.0, 0.0)))
    (obstacle,) = scene.obstacles_for("arm")
    assert np.allclose(obstacle.pose.position, (-0.5, 0.0, 0.5))
