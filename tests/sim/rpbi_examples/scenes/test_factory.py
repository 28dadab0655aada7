"""Both arms of a robot sort parts from a belt: tags lead them, they keep their distance, a miss is tried again."""

from __future__ import annotations

import pytest

from robot_model.geometry import Pose
from rpbi_examples.scenes import factory
from rpbi_examples.scenes.parts.belt import PARTS, grasp_yaw, is_in_box, on_belt
from rpbi_examples.scenes.parts.two_arms import DOWN, TwoArms
from rpbi_examples.scenes.scene import InputValue, Seen, run_scene
from rpbi_examples.scenes.task import EnvStage, make_env

LEFT_OUT, RIGHT_OUT = Pose((0.3, 0.25, 1.04), DOWN), Pose((0.3, -0.25, 1.04), DOWN)


@pytest.fixture(scope="module")
def env():
    found = make_env("factory")
    yield found
    found.close()


def test_camera_detects_exactly_the_parts_on_the_belt(env):
    belt_y_m = []
    env.task.seed = 201
    env.reset()
    scene = env.task.scene
    assert not scene.seen.tags, "the housing hides them"
    for position in range(150):
        env.world.put("conveyor/target", {"belt_joint": 0.003 * position})
        env.step(None)
        belt_y_m.append({part: tag.position[1] for part, tag in on_belt(scene.seen.tags).items()})
    assert 1 <= len(belt_y_m[-1]) < len(PARTS)
    for part in belt_y_m[-11]:
        seen, true = on_belt(scene.seen.tags)[part].position, scene.seen.poses[part].position
        assert seen[:2] == pytest.approx(true[:2], abs=0.004) and seen != true
        assert belt_y_m[-11][part] - belt_y_m[-1][part] == pytest.approx(0.03, abs=0.004), "friction carries it along"


class Stand:
    """A scene with a robot that stands still."""

    def __init__(self, joints):
        self.seen = Seen(joints={"nextage": joints})
        self.changes = []

    def put(self, slot, value):
        self.changes.append(InputValue(slot, value))


@pytest.mark.parametrize("least_m, is_sent", [(0.05, False), (-1.0, True)])
def test_arm_waits_instead_of_approaching_the_other_too_closely(env, least_m, is_sent):
    robot = env.world.bodies["nextage"]
    env.reset(seed=200)
    names = {joint.index: joint.name for joint in robot.model.moving}
    scene = Stand({names[index]: position for index, position in robot.joint_positions().items()})
    fingers = {"LHAND_JOINT0": 0.04, "RHAND_JOINT0": 0.04}
    links = {"left": "LHAND_tip", "right": "RHAND_tip"}
    arms = TwoArms(scene, "nextage", factory.URDF, "CHEST_JOINT0_Link", links, factory.CHEST, fingers, least_m)
    assert arms.send("left", LEFT_OUT) and arms.send("right", RIGHT_OUT)
    assert arms.send("left", Pose((0.45, 0.04, 1.0), DOWN))
    sent = len(scene.changes)
    assert arms.send("right", Pose((0.45, -0.04, 1.0), DOWN)) is is_sent
    assert (len(scene.changes) > sent) is is_sent
    assert arms.send("right", RIGHT_OUT), "the way out is always free"


def test_grasp_yaw_follows_the_shape_of_the_part():
    block, cube, cylinder = (PARTS[name] for name in ("block_1", "cube_1", "cylinder_1"))
    assert grasp_yaw(block, 2.0, -1.0) == pytest.approx(2.0 - 3.14159265)
    assert grasp_yaw(cube, 2.0, -1.0) == pytest.approx(2.0 - 3.14159265)
    assert grasp_yaw(cube, 0.4, -1.0) == pytest.approx(0.4 - 1.57079633)
    assert grasp_yaw(cylinder, 2.0, -1.0) == -1.0


def test_parts_count_in_the_compartment_of_their_kind_alone():
    assert is_in_box("cube_2", (0.20, 0.05, 0.9))
    assert not is_in_box("cube_2", (0.27, 0.05, 0.9)), "that of the cylinders"
    assert not is_in_box("cube_2", (0.20, 0.05, 0.96)), "above the rim"
    assert not is_in_box("cube_2", (0.20, 0.05, 0.02)), "on the floor"


class RoughStage(EnvStage):
    """Pushes a part that an arm works with off the belt, once both do."""

    lost = ""

    def cycle(self):
        super().cycle()
        scene = self._env.task.scene
        if not self.lost and all(scene._busy.values()):
            self.lost = scene._busy["right"]
            self._env.world.act(self.lost, "teleport", Pose((0.9, 0.0, 0.02)))


@pytest.mark.thorough
def test_missed_grasp_is_repeated_and_fallen_part_is_named(env, monkeypatch):
    monkeypatch.setattr(factory, "HELD_M", 1.0)
    monkeypatch.setattr(factory.Factory, "longest_s", 7.0)
    env.task.seed = 202
    env.reset()
    scene, stage = env.task.scene, RoughStage(env)
    result = run_scene(scene, stage)
    assert (result.done, result.of, result.reason) == (0, 6, "not done after 7 s")
    assert scene._tries.pop(stage.lost) == 1 and max(scene._tries.values()) > 1
    inside = {part: Pose((kind.x_m, 0.0, 0.9)) for part, kind in PARTS.items() if part != stage.lost}
    scene.look(scene.seen._replace(poses={**scene.seen.poses, **inside}))
    assert (scene.fault(), scene.score()) == (f"not in the box: {stage.lost}", (5, 6))
