"""Objects that nothing moves stand where their files say, or where the main file says that their frame is."""

from __future__ import annotations

import math

import pybullet
import pytest
from worlds import ball, box, iiwa, write_world

from rpbi.geometry import Pose
from rpbi.world import World

HALF = math.sqrt(0.5)
PLACE = {"basePosition": [1.0, 2.0, 0.5], "baseOrientation": [0.0, 0.0, HALF, HALF]}


@pytest.fixture
def build(tmp_path):
    worlds = []

    def build_world(**parts) -> World:
        worlds.append(World.from_file(write_world(tmp_path, **parts), connection_mode=pybullet.DIRECT))
        return worlds[-1]

    yield build_world
    for world in worlds:
        world.close()


def still(name, **more):
    return {key: value for key, value in box(name, **more).items() if key != "baseMass"}


def picture(name, **more):
    return {"name": name, "createVisualShape": {"shapeType": "GEOM_SPHERE", "radius": 0.1}, **more}


def at(world, name):
    position, quat = world.bodies[name].base_pose()
    return position, pytest.approx(quat)


@pytest.mark.parametrize("maximal", [False, True])
def test_visual_and_collision_objects_are_placed_as_in_their_files(build, maximal):
    shelf = still("shelf", useMaximalCoordinates=maximal, **PLACE)
    on_it = ball("on_it", basePosition=[1.0, 2.0, 0.7])
    world = build(visual=(picture("sign", **PLACE), picture("origin")), collision=(shelf,), dynamic=(on_it,))
    for _ in range(300):
        world.step()
    for name in ("sign", "shelf"):
        assert at(world, name) == ((1.0, 2.0, 0.5), (0.0, 0.0, HALF, HALF))
    assert world.bodies["origin"].base_pose().position == (0.0, 0.0, 0.0)
    assert world.bodies["on_it"].base_pose().position[2] == pytest.approx(0.7, abs=1e-3)


def test_object_following_a_configured_frame_is_placed_before_tick_one(build):
    poses = [{"tf_id": "rpbi/table", "position": [1.0, 0.0, 0.5]}, {"tf_id": "eye", "position": [0.0, 0.0, 3.0]}]
    arm = iiwa(object_tf={"tf_id": "rpbi/table"}, loadURDF={"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True})
    table = still("table", object_tf={"tf_id": "rpbi/table"})
    lone = still("lone", object_tf={"tf_id": "nobody"}, basePosition=[0.0, 5.0, 0.0])
    camera = {"name": "camera", "object_tf": {"tf_id": "left/eye"}}
    sign = picture("sign", object_tf={"tf_id": "left/rpbi/table"})
    world = build(
        visual=(sign,), collision=(table, lone), robots=(arm,), rgbd_sensor=camera, poses=poses, tf_prefix="left"
    )
    for _ in range(2):
        for name in ("sign", "table", "iiwa"):
            assert world.bodies[name].base_pose().position == pytest.approx((1.0, 0.0, 0.5), abs=1e-12)
        assert world.bodies["lone"].base_pose().position == (0.0, 5.0, 0.0)
        assert world.cameras["camera"].pose == Pose((0.0, 0.0, 3.0))
        world.step()
        world.reset()
    world.put("table/pose", Pose((1.0, 0.0, 0.6)))  # it follows all the same
    for _ in range(500):
        world.step()
    assert world.bodies["table"].base_pose().position == pytest.approx((1.0, 0.0, 0.6), abs=1e-6)
