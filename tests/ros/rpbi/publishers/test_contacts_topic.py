"""The contacts of a body as users get them: a topic for programs, arrows for RViz."""

from __future__ import annotations

import pytest
from node_world import add, main_config, objects, remove
from ros_system import wait_until
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray
from worlds import FLOOR, box

from ros_pybullet_interface.msg import Contacts, PybulletObject

WEIGHT_N = 2.0 * 9.81
DOOR = """<robot name="crate"><link name="body"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link></robot>"""


@pytest.fixture(scope="module")
def node(module_ros):
    crate = box(baseMass=2.0, basePosition=[0.0, 0.0, 0.1], contacts={"hz": 100, "arrows_hz": 20})
    config = main_config(module_ros.folder, collision=(FLOOR,), dynamic=(crate,), timeStep=0.002)
    return module_ros.simulator(config, use_sim_time=True)


@pytest.mark.quick
def test_contacts_of_a_resting_box_carry_its_weight(ros, node):
    messages = ros.listen("/rpbi/box/contacts", Contacts)
    wait_until(lambda: messages.messages and messages.messages[-1].header.stamp.to_sec() > 1.0, "a second has passed")
    last = messages.messages[-1]
    assert last.header.frame_id == "rpbi/world"
    assert last.force.z == pytest.approx(WEIGHT_N, rel=0.01)
    assert {(point.other_body, point.link) for point in last.points} == {("floor", "link0")}
    assert sum(point.normal_force * point.normal.z for point in last.points) == pytest.approx(WEIGHT_N, rel=0.01)
    stamps = messages.stamps_ns
    assert {new - old for old, new in zip(stamps, stamps[1:])} == {10_000_000}


def test_arrows_replace_those_before(ros, node):
    arrows = ros.listen("/rpbi/box/contacts/arrows", MarkerArray).wait_for(3)[-1].markers
    assert arrows[0].action == Marker.DELETEALL
    assert len(arrows) > 1
    for arrow in arrows[1:]:
        assert (arrow.type, arrow.action, arrow.header.frame_id) == (Marker.ARROW, Marker.ADD, "rpbi/world")
        assert len(arrow.points) == 2
    lengths = [arrow.points[1].z - arrow.points[0].z for arrow in arrows[1:]]
    assert sum(lengths) == pytest.approx(0.01 * WEIGHT_N, rel=0.01)


def test_late_subscriber_of_a_stopped_world_receives_its_last_contacts(ros, node):
    assert ros.call("/rpbi/stop", Trigger).success
    try:
        (message,) = ros.listen("/rpbi/box/contacts", Contacts).wait_for(1)
        assert message.force.z == pytest.approx(WEIGHT_N, rel=0.01)
    finally:
        assert ros.call("/rpbi/start", Trigger).success


def test_urdf_object_added_by_service_publishes_contacts_until_removed(ros, node):
    (ros.folder / "crate.urdf").write_text(DOOR)
    load = {"fileName": str(ros.folder / "crate.urdf"), "basePosition": [1.0, 0.0, 0.1]}
    answer = add(ros, PybulletObject.URDF, {"name": "crate", "loadURDF": load, "contacts": {"hz": 100}})
    assert answer.success, answer.message
    assert objects(ros)["crate"] == "urdf"
    messages = ros.listen("/rpbi/crate/contacts", Contacts)
    points = wait_until(lambda: messages.messages[-1].points, "it touches the floor")
    assert {point.link for point in points} == {"body"}
    assert remove(ros, "crate").success
    assert "crate" not in objects(ros)


def test_a_wrong_key_is_refused_by_name(ros, node):
    answer = add(ros, PybulletObject.DYNAMIC, box("second", contacts={"hz": -1}))
    assert not answer.success
    assert "contacts.hz: must be > 0 [Hz], got -1" in answer.message
    answer = add(ros, PybulletObject.SOFT, {"name": "jelly", "loadSoftBody": {"fileName": "cloth_z_up.obj"}})
    assert not answer.success
    assert "soft bodies need resetSimulation: {flags: RESET_USE_DEFORMABLE_WORLD}" in answer.message
