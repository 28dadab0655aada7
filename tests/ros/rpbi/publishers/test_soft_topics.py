"""Soft bodies in ROS: their surface for RViz, services that fit, objects that come and go, a reset."""

from __future__ import annotations

import numpy as np
import pytest
from custom_srvs.srv import SetTransform
from geometry_msgs.msg import Quaternion, Transform, Vector3
from node_world import add, main_config, objects, remove
from ros_system import wait_until
from soft_meshes import DEFORMABLE, GROUND, block
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker

from ros_pybullet_interface.msg import Contacts, PybulletObject
from ros_pybullet_interface.srv import GetObjectDynamics


@pytest.fixture(scope="module")
def node(module_ros):
    soft = block(module_ros.folder, surface_hz=25, changeVisualShape={"rgbaColor": [0.2, 0.8, 0.1, 1.0]})
    config = main_config(module_ros.folder, collision=(GROUND,), soft=(soft,), timeStep=0.004, **DEFORMABLE)
    return module_ros.simulator(config, use_sim_time=True)


def heights(marker):
    return np.array([point.z for point in marker.points])


@pytest.mark.quick
def test_its_surface_is_a_list_of_triangles_in_the_world(ros, node):
    surface = ros.listen("/rpbi/jelly/surface", Marker)
    wait_until(lambda: surface.messages and heights(surface.messages[-1]).min() < 0.02, "it has fallen")
    last = surface.messages[-1]
    assert (last.type, last.action, last.ns) == (Marker.TRIANGLE_LIST, Marker.ADD, "jelly")
    assert last.header.frame_id == "rpbi/world"
    assert len(last.points) == 3 * 108
    assert (last.color.r, last.color.g, last.color.b) == pytest.approx((0.2, 0.8, 0.1))
    stamps = surface.stamps_ns
    assert {new - old for old, new in zip(stamps, stamps[1:])} == {40_000_000}


def test_soft_body_can_be_moved_and_refuses_other_services(ros, node):
    surface = ros.listen("/rpbi/jelly/surface", Marker)
    surface.wait_for(1)
    up = Transform(Vector3(0.0, 0.0, 3.0), Quaternion(0.0, 0.0, 0.0, 1.0))
    assert ros.call("/rpbi/jelly/set_pose", SetTransform, up).success
    wait_until(lambda: any(heights(each).min() > 2.0 for each in list(surface.messages)), "it is up there")
    answer = ros.call("/rpbi/get_pybullet_object_dynamics", GetObjectDynamics, "jelly")
    assert not answer.success
    assert "'jelly' is soft" in answer.message


def test_soft_bodies_come_and_go_by_service(ros, node):
    config = block(ros.folder, "second", load={"basePosition": [1.0, 0.0, 0.3]}, contacts={"hz": 50})
    for _ in range(3):
        answer = add(ros, PybulletObject.SOFT, config)
        assert answer.success, answer.message
        assert objects(ros)["second"] == "soft"
        contacts = ros.listen("/rpbi/second/contacts", Contacts)
        wait_until(lambda c=contacts: c.messages and c.messages[-1].points, "it lies on the ground")
        contacts.close()
        assert remove(ros, "second").success
    refused = add(ros, PybulletObject.SOFT, {**config, "createSoftBodyAnchor": [[0, "nobody"]]})
    assert not refused.success
    assert "createSoftBodyAnchor[0]: expected the name of a rigid body" in refused.message
    assert objects(ros) == {"ground": "collision", "jelly": "soft"}


def test_a_reset_puts_it_back(ros, node):
    surface = ros.listen("/rpbi/jelly/surface", Marker)
    surface.wait_for(1)
    count = len(surface.messages)
    assert ros.call("/rpbi/reset", Trigger).success
    wait_until(lambda: any(heights(each).max() > 0.9 for each in surface.messages[count:]), "it falls again")
    wait_until(lambda: heights(surface.messages[-1]).min() < 0.02, "it has fallen")
