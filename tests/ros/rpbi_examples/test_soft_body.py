"""The example with the soft body, as a user launches it: torus and cube fall on the plane."""

from __future__ import annotations

import numpy as np
import pytest
from ros_system import RosSystem, wait_until
from sensor_msgs.msg import Image
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

from ros_pybullet_interface.msg import Contacts

pytestmark = pytest.mark.thorough

SLOW_S = 120.0


@pytest.fixture(scope="module")
def example(ros_master, tmp_path_factory):
    system = RosSystem(tmp_path_factory.mktemp("soft_body"))
    try:
        system.start(["roslaunch", "rpbi_examples", "soft_body.launch", "headless:=true"])
        yield system
    finally:
        system.close()


def _heights(surface):
    return [point.z for point in surface.messages[-1].points]


def test_the_torus_falls_flat_and_keeps_its_thickness(example):
    surface = example.listen("/rpbi/torus/surface", Marker)
    surface.wait_for(1, SLOW_S)
    wait_until(lambda: surface.messages[-1].header.stamp.to_sec() > 4.0, "4 s have passed", SLOW_S)
    heights = _heights(surface)
    assert -0.02 < min(heights) < 0.03
    assert 0.3 < max(heights) < 0.55


def test_the_cube_ends_on_the_plane(example):
    transforms = example.listen("/tf", TFMessage)
    contacts = example.listen("/rpbi/cube/contacts", Contacts)

    def rests():
        messages = [each for message in list(transforms.messages) for each in message.transforms]
        cube = [each.transform.translation.z for each in messages if each.child_frame_id == "rpbi/cube/baseLink"]
        return cube and abs(cube[-1] - 0.5) < 0.01

    wait_until(rests, "the cube lies", SLOW_S)
    wait_until(
        lambda: contacts.messages and contacts.messages[-1].force.z == pytest.approx(10.0, rel=0.05),
        "the plane carries its 1 kg",
        SLOW_S,
    )


def test_the_camera_sees_the_torus(example):
    image = example.listen("/rpbi/camera/colour/image", Image).wait_for(1, SLOW_S)[-1]
    pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3).astype(int)
    red = (pixels[..., 0] > 1.5 * pixels[..., 1]) & (pixels[..., 0] > 1.5 * pixels[..., 2])
    assert np.count_nonzero(red) > 2000
