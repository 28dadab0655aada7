"""The services that tell and change dynamics while the simulator runs."""

from __future__ import annotations

import math

import pytest
from node_world import main_config
from ros_system import wait_until
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from worlds import FLOOR, box, iiwa

from ros_pybullet_interface.srv import ChangeDynamics, ChangeObjectDynamics, GetObjectDynamics


@pytest.fixture(scope="module")
def node(module_ros):
    config = main_config(
        module_ros.folder,
        collision=(FLOOR,),
        dynamic=(
            box(basePosition=[0.0, 1.0, 0.1], broadcast_hz=100),
            box("crate", basePosition=[0.0, -1.0, 0.1]),
        ),
        robots=(iiwa(),),
        setAdditionalSearchPath="pybullet_data_path",
        setGravity={"gravX": 9.81 * math.sin(0.35), "gravZ": -9.81 * math.cos(0.35)},
    )
    return module_ros.simulator(config, use_sim_time=True)


@pytest.fixture
def simulator(ros, node):
    ros.call("/rpbi/start", Trigger)
    return node


def get(ros, name):
    answer = ros.call("/rpbi/get_pybullet_object_dynamics", GetObjectDynamics, name)
    assert answer.success, answer.message
    return answer.object_dynamics


def change(ros, name, dynamics):
    return ros.call("/rpbi/change_pybullet_object_dynamics", ChangeObjectDynamics, name, dynamics)


@pytest.mark.quick
def test_edited_dynamics_sent_back_change_only_the_edited_values(ros, simulator):
    for name in ("crate", "iiwa/lbr_iiwa_link_7"):
        dynamics = get(ros, name)
        same = change(ros, name, dynamics)
        assert (same.success, same.message) == (True, "nothing differs")
        before = dynamics.mass
        dynamics.mass, dynamics.lateral_friction = 2 * before, 0.125
        answer = change(ros, name, dynamics)
        # moments of inertia were sent back unchanged, so they go with the mass
        assert (answer.success, answer.message) == (True, "changed mass, lateralFriction")
        now = get(ros, name)
        assert (now.mass, now.lateral_friction) == (2 * before, 0.125)
        assert now.local_inertia_diagonal == pytest.approx([2 * each for each in dynamics.local_inertia_diagonal])


def test_box_slides_off_once_its_friction_is_lowered(ros, simulator):
    places = []

    def place():
        for transform in (each for message in tf.messages for each in message.transforms):
            if transform.child_frame_id == "rpbi/box":
                places.append(transform.transform.translation.x)
        tf.messages.clear()
        return places[-1] if places else None

    tf = ros.listen("/tf", TFMessage)
    wait_until(lambda: place() is not None, "the box is on TF")
    assert abs(places[-1]) < 0.01
    answer = ros.call("/rpbi/change_dynamics", ChangeDynamics, "box", "{lateralFriction: 0.05, linearDamping: 0.0}")
    assert (answer.success, answer.message) == (True, "changed lateralFriction, linearDamping")
    wait_until(lambda: (place() or 0.0) > 0.2, "the box slides")


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"mass": math.nan}, "mass: must be finite, got nan"),
        ({"mass": 0.0, "restitution": 0.9}, "mass: must be > 0"),
        ({"restitution": -1.0, "mass": 9.0}, "restitution: must be >= 0"),
        ({"local_inertia_diagonal": [1.0]}, "local_inertia_diagonal: expected 3 numbers or none, got 1"),
        ({"local_inertia_orn": [0.0, 0.0, 1.0, 0.0]}, "local_inertia_orn: cannot be changed"),
        ({"contact_stiffness": 100.0}, "contact_damping: must be >= 0 when the other is set"),
    ],
)
def test_nonsense_is_named_by_field_and_changes_nothing(ros, simulator, fields, message):
    before = get(ros, "crate")
    asked = get(ros, "crate")
    for field, value in fields.items():
        setattr(asked, field, value)
    answer = change(ros, "crate", asked)
    assert not answer.success and message in answer.message
    assert get(ros, "crate") == before


@pytest.mark.parametrize(
    ("name", "config", "message"),
    [
        ("crate", "{lateralFrictoin: 0.1}", "unknown key 'lateralFrictoin'; did you mean 'lateralFriction'?"),
        ("crate", "{restitution: -0.1}", "config: restitution: must be >= 0"),
        ("crate", "{restitution: .nan}", "config: restitution: "),
        ("crate", "{contactStiffness: 100.0}", "contactDamping: missing"),
        ("crate", "", "expected"),
        ("crate", "{}", "expected keys of changeDynamics"),
        ("crate", "[1, 2", "config: "),
        ("crate", "{mass: 0.0}", "mass: must be > 0 [kg]"),
        ("floor", "{mass: 5.0}", "'floor' is static"),
        ("crete", "{mass: 5.0}", "unknown object 'crete'"),
        ("iiwa/link_7", "{mass: 5.0}", "unknown link of iiwa 'link_7'"),
    ],
)
def test_bad_requests_are_refused_by_key_and_change_nothing(ros, simulator, name, config, message):
    before = get(ros, "crate")
    answer = ros.call("/rpbi/change_dynamics", ChangeDynamics, name, config)
    assert not answer.success and message in answer.message, answer.message
    assert get(ros, "crate") == before


def test_unknown_names_are_reported_with_known_ones(ros, simulator):
    answer = ros.call("/rpbi/get_pybullet_object_dynamics", GetObjectDynamics, "crete")
    assert not answer.success
    assert answer.message == "unknown object 'crete': known are floor, box, crate, iiwa; did you mean 'crate'?"


def test_dynamics_change_while_stopped_too(ros, simulator):
    ros.call("/rpbi/stop", Trigger)
    assert ros.call("/rpbi/change_dynamics", ChangeDynamics, "crate", "rollingFriction: 0.03").success
    assert get(ros, "crate").rolling_friction == pytest.approx(0.03)
