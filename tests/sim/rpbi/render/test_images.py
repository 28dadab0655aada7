"""What cameras see as arrays, drawn in the process of the world."""

from __future__ import annotations

import numpy as np
import pytest
from rendering import Rendering, project
from worlds import FLOOR, box, write_world

from custom_ros_tools.errors import UnknownNameError
from rpbi.config.sensors import RgbdSensorConfig
from rpbi.geometry import Pose
from rpbi.images import CameraImages, looking_at
from rpbi.render.frame import Camera
from rpbi.world import World

EYE, TARGET = (1.0, -2.0, 1.5), (0.1, 0.2, 0.3)
CAMERA = {"name": "eye", "intrinsics": {"width": 160, "height": 120, "fov": 50}, "object_tf": {"tf_id": "rpbi/eye"}}


@pytest.fixture
def world(tmp_path):
    main = write_world(tmp_path, collision=(FLOOR,), dynamic=(box(basePosition=TARGET),), rgbd_sensor=CAMERA)
    world = World.from_file(main)
    yield world
    world.close()


@pytest.fixture
def images(world):
    images = CameraImages(world)
    yield images
    images.close()


def test_images_are_those_of_the_renderer_process(world, images, tmp_path):
    pose = looking_at(EYE, TARGET)
    world.put("eye/pose", pose)
    frame = images.frame("eye")
    process = Rendering(tmp_path, world, (Camera.of(world.cameras["eye"].config),), use_egl=False)
    process.demand("colour", "depth", "segmentation")
    other = process.look(pose)
    process.client.stop()
    for name in ("colour", "depth", "segmentation"):
        assert np.array_equal(getattr(frame, name), other[name]), name
    assert len(np.unique(frame.segmentation)) == 3, "floor, box, and nothing"


def test_images_show_the_current_world(world, images):
    world.put("eye/pose", looking_at(EYE, TARGET))
    first = world.bodies["box"].body_id
    assert (images.frame().segmentation == first).any()
    world.remove("box")
    assert not (images.frame().segmentation == first).any()
    world.add("dynamic", box("other", basePosition=TARGET))
    assert (images.frame().segmentation == world.bodies["other"].body_id).any()
    before = images.frame()
    world.act("other", "teleport", {"position": [0.1, 0.2, 0.8]})
    assert not np.array_equal(images.frame().depth, before.depth)
    world.reset()
    assert np.array_equal(images.frame().depth, before.depth), "a box is where it was, and the camera too"


def test_unknown_camera_and_camera_without_pose_are_named(images):
    with pytest.raises(ValueError, match="where is 'eye'\\? Put its pose into 'eye/pose'"):
        images.frame()
    with pytest.raises(UnknownNameError, match="unknown camera 'eyes'.*did you mean 'eye'?"):
        images.frame("eyes")


def test_a_camera_that_came_later_has_its_own_size(world, images):
    size = {"width": 40, "height": 30}
    world.add_camera({**CAMERA, "name": "late", "intrinsics": size})
    world.put("late/pose", Pose((0.0, 0.0, 2.0), (1.0, 0.0, 0.0, 0.0)))
    assert images.frame("late").depth.shape == (30, 40)


@pytest.mark.parametrize("position", [EYE, (-1.0, 0.5, 0.1), (0.1, 0.2, 3.0), (0.1, 0.2, -3.0)])
def test_looking_at_centres_the_target_and_levels_the_horizon(position):
    K = Camera.of(RgbdSensorConfig.parse(CAMERA, "eye")).intrinsics.K
    pose = looking_at(position, TARGET)
    (u, v, depth), *beside = project([TARGET, np.add(TARGET, (0.0, 0.0, 0.1))], pose, K)
    assert (u, v) == pytest.approx((79.5, 59.5), abs=1e-6)
    assert depth == pytest.approx(np.linalg.norm(np.subtract(position, TARGET)))
    assert beside[0][0] == pytest.approx(79.5, abs=1e-6), "what is above the target is above it in the image"
    assert beside[0][1] <= 59.5 + 1e-6


def test_looking_at_itself_makes_no_sense():
    with pytest.raises(ValueError, match="target: must not be where the camera is"):
        looking_at(EYE, EYE)
