"""What a camera sees, as far as the world is concerned."""

from __future__ import annotations

import pytest
import yaml
from worlds import FLOOR, box, iiwa, write_world

from custom_ros_tools.errors import ConfigError, UnknownNameError
from rpbi.config.sensors import RgbdSensorConfig
from rpbi.geometry import Pose
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


def test_no_scene_is_collected_without_viewers(world):
    world.put("eye/pose", POSE)
    assert not scenes(world, 100)


def test_there_is_no_scene_before_the_camera_has_a_pose(world):
    world.cameras["eye"].wanted = True
    assert not scenes(world, 100)
    world.put("eye/pose", POSE)
    assert scenes(world, 100)


def test_scenes_come_at_the_camera_rate_with_tick_stamps(world):
    world.put("eye/pose", POSE)
    world.cameras["eye"].wanted = True
    found = scenes(world, 1000)
    assert len(found) == 25
    assert all(scene.stamp_ns == (scene.tick + 1) * world.clock.dt_ns for scene in found)


def test_scene_contains_the_pose_of_every_body(world):
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


def further(folder, name):
    (folder / f"{name}.yaml").write_text(yaml.safe_dump({**CAMERA, "name": name}))
    return f"{name}.yaml"


def topic_names(world):
    return {name: camera.topic_name for name, camera in world.cameras.items()}


def test_first_camera_uses_topic_camera_and_others_their_names(tmp_path):
    files = [further(tmp_path, "left"), {"file": "left.yaml", "name": "right"}]
    world = World.from_file(write_world(tmp_path, rgbd_sensor=CAMERA, rgbd_sensors=files))
    assert topic_names(world) == {"eye": "camera", "left": "left", "right": "right"}
    world.close()
    world = World.from_file(write_world(tmp_path, rgbd_sensors=files))
    assert topic_names(world) == {"left": "camera", "right": "right"}
    world.close()


def test_cameras_come_and_go_and_their_names_are_free_again(world):
    config = RgbdSensorConfig.parse({**CAMERA, "name": "late"}, "late.yaml")
    world.add_camera(config)
    world.put("late/pose", POSE)
    world.cameras["late"].wanted = True
    assert any(getattr(sample, "name", None) == "late" for _ in range(100) for sample in world.step())
    world.remove("late")
    with pytest.raises(UnknownNameError):
        world.put("late/pose", POSE)
    assert not any(getattr(sample, "name", None) == "late" for _ in range(100) for sample in world.step())
    world.add_camera(config)
    assert topic_names(world) == {"eye": "camera", "late": "late"}


@pytest.mark.parametrize("name, complaint", [("eye", "is taken"), ("box", "is taken"), ("camera", "the first camera")])
def test_camera_with_a_used_name_is_refused_without_any_change(world, name, complaint):
    cameras = dict(world.cameras)
    with pytest.raises(ConfigError, match=f"late.yaml: name: .*{complaint}"):
        world.add_camera(RgbdSensorConfig.parse({**CAMERA, "name": name}, "late.yaml"), "late.yaml")
    assert world.cameras == cameras


def test_reset_keeps_camera_poses_and_removes_cameras_added_later(world):
    world.put("eye/pose", POSE)
    world.step()
    world.add_camera(RgbdSensorConfig.parse({**CAMERA, "name": "late"}, "late.yaml"))
    world.reset()
    assert topic_names(world) == {"eye": "camera"}
    assert world.cameras["eye"].pose == pytest.approx(POSE)
    world.remove("eye")
    world.reset()
    assert topic_names(world) == {"eye": "camera"}


def test_problems_of_all_further_cameras_are_reported_with_their_files(tmp_path):
    (tmp_path / "bad.yaml").write_text("{name: eye, hz: fast, depth_noise_m: -1.0}")
    (tmp_path / "camera.yaml").write_text("{name: camera, object_tf: {tf_id: eye}}")
    files = ["bad.yaml", "camera.yaml", "nowhere.yaml", 3]
    path = write_world(tmp_path, rgbd_sensor=CAMERA, rgbd_sensors=files)
    with pytest.raises(ConfigError) as error:
        World.from_file(path)
    text = str(error.value)
    for expected in (
        "bad.yaml: name: 'eye' is taken by",
        "bad.yaml: hz: expected a number [Hz], got",
        "bad.yaml: depth_noise_m: must be >= 0 [m]",
        "bad.yaml: object_tf: missing",
        "camera.yaml: name: topics of the first camera are named 'camera'",
        "rgbd_sensors[2]",
        "rgbd_sensors[3]",
    ):
        assert expected in text, text
