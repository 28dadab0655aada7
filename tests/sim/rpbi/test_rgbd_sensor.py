"""What a camera sees, as far as the world is concerned."""

from __future__ import annotations

import pytest
from worlds import FLOOR, box, iiwa, write_world

from rpbi.pose import Pose
from rpbi.world import World

CAMERA = {"name": "eye", "hz": 25, "object_tf": {"tf_id": "rpbi/eye"}}
POSE = Pose((1.0, 2.0, 3.0), (0.0, 0.6, 0.0, 0.8))


def make_world(folder, **camera):
    return World.from_file(
        write_world(
            folder,
            collision=(FLOOR,),
            dynamic=(box(basePosition=[0.5, 0.0, 2.0]),),
            robots=(iiwa(initial_joint_position={"lbr_iiwa_joint_2": 40.0}),),
            setAdditionalSearchPath="pybullet_data_path",
            rgbd_sensor={**CAMERA, **camera},
        )
    )


@pytest.fixture
def world(tmp_path):
    world = make_world(tmp_path)
    yield world
    world.close()


def scenes(world, ticks):
    return [sample for _ in range(ticks) for sample in world.step() if getattr(sample, "name", None) == "eye"]


def test_nothing_is_collected_while_nobody_looks(world):
    world.put("eye/pose", POSE)
    assert not scenes(world, 100)


def test_there_is_no_scene_before_the_camera_has_a_pose(world):
    world.cameras["eye"].wanted = True
    assert not scenes(world, 100)
    world.put("eye/pose", POSE)
    assert scenes(world, 100)


def test_scenes_come_at_the_cameras_rate_with_the_stamps_of_their_ticks(world):
    world.put("eye/pose", POSE)
    world.cameras["eye"].wanted = True
    found = scenes(world, 1000)
    assert len(found) == 25
    assert all(scene.stamp_ns == (scene.tick + 1) * world.clock.dt_ns for scene in found)


def test_scene_tells_where_every_body_is(world):
    world.put("eye/pose", POSE)
    world.cameras["eye"].wanted = True
    scene = scenes(world, 40)[0]
    assert scene.camera == pytest.approx(POSE)
    states = {state.name: state for state in scene.bodies}
    assert set(states) == {"floor", "box", "iiwa"}
    assert scene.tick == world.clock.tick
    for name, state in states.items():
        body = world.bodies[name]
        position, quat_xyzw = world.pb.getBasePositionAndOrientation(body.body_id)
        assert state.base == position + quat_xyzw
        assert state.joints == tuple(world.pb.getJointState(body.body_id, index)[0] for index in body.joint_indices)


@pytest.mark.parametrize("key", ["pointcloud", "synchronous"])
def test_what_is_not_there_yet_is_said(tmp_path, caplog, key):
    make_world(tmp_path, **{key: True}).close()
    assert f"{key}: has no effect yet" in caplog.text
