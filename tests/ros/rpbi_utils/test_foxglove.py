"""The bridge to Foxglove and Lichtblick: the demo, seen by a viewer that speaks their protocol."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
import rosgraph
import roslib.message
import rospy
from foxglove_bridge import FoxgloveBridge, publications, subscriptions
from foxglove_client import FoxgloveClient, lost
from ros_system import wait_until
from roslaunch.config import load_config_default
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

ROOT = Path(__file__).resolve().parents[3]
LAYOUTS = ROOT / "src/rpbi_utils/configs/foxglove"
STATES, IMAGES = "/rpbi/kuka_lwr/joint_states", "/rpbi/camera/colour/image"
TARGETS = f"{STATES}/target"
LOGGER = ("ros", "INFO")
"""Request that each node's `set_logger_level` takes."""


@pytest.fixture(scope="module")
def demo(module_ros) -> FoxgloveBridge:
    """The bridge next to the running demo."""
    module_ros.start(["roslaunch", "rpbi_examples", "basic_example_kuka_lwr.launch", "headless:=true", "move:=false"])
    bridge = FoxgloveBridge(module_ros, is_launched=True)
    rospy.wait_for_service("/rpbi/list_objects", 120.0)
    return bridge


@pytest.fixture
def viewer(demo) -> Iterator[FoxgloveClient]:
    with FoxgloveClient(demo.port) as client:
        yield client


def written(message: Any) -> bytes:
    """Returns the bytes of a message."""
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def test_topics_are_offered_as_they_are(demo, viewer):
    types = dict(rosgraph.Master("/tests").getTopicTypes())
    published = {topic for topic, _ in rosgraph.Master("/tests").getSystemState()[0]}
    wait_until(lambda: published <= viewer.channels.keys(), "all topics are offered")
    for topic in published:
        channel = viewer.channels[topic]
        assert (channel["encoding"], channel["schemaEncoding"]) == ("ros1", "ros1msg")
        assert channel["schemaName"] == types[topic]
        assert channel["schema"] == roslib.message.get_message_class(types[topic])._full_text
    assert "/rpbi/no_such_topic" not in viewer.channels


def test_only_requested_topics_are_subscribed_to(demo):
    wait_until(lambda: subscriptions() == set(), "no topic is subscribed to")
    with FoxgloveClient(demo.port) as one, FoxgloveClient(demo.port) as other:
        wait_until(lambda: STATES in one.channels, "topics are offered")
        assert subscriptions() == set()
        one.subscribe(STATES)
        other.subscribe(STATES, "/tf")
        wait_until(lambda: subscriptions() == {STATES, "/tf", "/clock"}, "the bridge subscribes")
        wait_until(lambda: one.messages[STATES] and other.messages[STATES], "messages come")
        one.unsubscribe(STATES)
        assert subscriptions() == {STATES, "/tf", "/clock"}
    wait_until(lambda: subscriptions() == set(), "the bridge leaves all topics with the last viewer")


@pytest.mark.parametrize("count", [3, pytest.param(600, marks=pytest.mark.thorough)])
def test_camera_images_pass_with_equal_bytes(demo, viewer, count):
    seen, missing, changed = lost(demo.ros, viewer, IMAGES, count)
    assert (missing, changed) == (0, 0) and seen >= count
    assert len(viewer.messages[IMAGES][0][1]) > 640 * 480 * 3


def test_latched_topics_reach_later_viewers(demo, viewer):
    viewer.subscribe("/rpbi/markers")
    wait_until(lambda: viewer.messages["/rpbi/markers"], "the markers come")
    with FoxgloveClient(demo.port) as later:
        later.subscribe("/rpbi/markers", "/tf_static")
        wait_until(lambda: later.messages["/rpbi/markers"] and later.messages["/tf_static"], "they come again")
        assert later.messages["/rpbi/markers"][-1][1] == viewer.messages["/rpbi/markers"][-1][1]


def test_viewer_moves_the_arm(demo, viewer):
    channel = viewer.advertise(TARGETS, "sensor_msgs/JointState")
    states = demo.ros.listen(STATES, JointState)
    joint = "lwr_arm_0_joint"
    number = states.wait_for()[0].name.index(joint)
    for goal in (0.3, 0.0):
        target = written(JointState(name=[joint], position=[goal]))
        wait_until(
            lambda: viewer.publish(channel, target) or abs(states.messages[-1].position[number] - goal) < 0.02,  # noqa: B023
            "the arm is there",
        )
    states.close()
    viewer.op("unadvertise", channelIds=[channel])
    wait_until(lambda: TARGETS not in publications(), "the bridge publishes it no more")


def test_all_services_of_the_demo_answer(demo, viewer):
    served = {name for name, _ in rosgraph.Master("/tests").getSystemState()[2]}
    wait_until(lambda: served <= viewer.services.keys(), "all services are offered")
    for name in sorted(served):
        service = viewer.services[name]
        service_class = roslib.message.get_service_class(service["type"])
        assert service["request"]["schema"] == service_class._request_class._full_text
        request = service_class._request_class(*(LOGGER if name.endswith("set_logger_level") else ()))
        try:
            answer = viewer.call(name, written(request))
        except ValueError:  # the one service of roscpp that drops calls of rospy, too
            assert name == "/rosout/set_logger_level"
            with pytest.raises(rospy.ServiceException):
                rospy.ServiceProxy(name, service_class)(request)
            continue
        assert written(service_class._response_class().deserialize(answer)) == answer, name
    viewer.call("/rpbi/reset", b"")
    assert Trigger._response_class().deserialize(viewer.call("/rpbi/start", b"")).message
    with pytest.raises(ValueError, match="request is no"):
        viewer.call("/rpbi/remove_pybullet_object", b"\xff\xff\xff\xff")


def test_parameters_are_read_and_set(demo, viewer):
    rospy.set_param("/shown", {"a": 1, "b": [1.5, 2.5], "c": "text", "d": True})
    every = viewer.get_parameters()
    assert {name: every[name] for name in every if name.startswith("/shown/")} == {
        "/shown/a": 1,
        "/shown/b": [1.5, 2.5],
        "/shown/c": "text",
        "/shown/d": True,
    }
    assert "<robot" in every["/robot_description"]
    assert viewer.get_parameters("/shown/a", "/no_such_parameter") == {"/shown/a": 1}
    viewer.op("setParameters", parameters=[{"name": "/shown/c", "value": "new"}], id="x")
    wait_until(lambda: rospy.get_param("/shown/c") == "new", "the viewer sets it")
    rospy.delete_param("/shown")


def test_time_of_the_viewer_is_that_of_the_clock(demo, viewer):
    viewer.subscribe(STATES)
    wait_until(lambda: len(viewer.times_ns) > 3 and viewer.messages[STATES][-1][0], "the bridge knows the time")
    stamp_s = JointState().deserialize(viewer.messages[STATES][-1][1]).header.stamp.to_sec()
    assert abs(viewer.times_ns[-1] * 1e-9 - stamp_s) < 1.0
    assert abs(viewer.messages[STATES][-1][0] * 1e-9 - stamp_s) < 1.0


def test_meshes_are_read_and_other_files_are_not(demo, viewer):
    robot = viewer.fetch("package://rpbi_examples/robots/kuka_lwr.urdf")
    assert robot == (ROOT / "src/rpbi_examples/robots/kuka_lwr.urdf").read_bytes()
    refused = (
        "package://rpbi_examples/package.xml",
        "package://rpbi_examples/../../../../etc/passwd",
        "package://rpbi_examples/robots/../../../README.stl",
        "file:///etc/passwd",
        "/etc/passwd.stl",
        "package://no_such_package/a.stl",
        "package:///a.stl",
    )
    assert [viewer.fetch(uri) for uri in refused] == [None] * len(refused)


@pytest.mark.parametrize("layout", ["kuka_lwr", "mobile_base"])
def test_layouts_have_panels_for_all_their_parts(layout):
    data = json.loads((LAYOUTS / f"{layout}.json").read_text())
    assert set(re.findall(r'"(\w+!\w+)"', json.dumps(data["layout"]))) == data["configById"].keys()


def test_layout_names_topics_and_services_of_the_demo(demo, viewer):
    text = (LAYOUTS / "kuka_lwr.json").read_text()
    names = set(re.findall(r'"(/rpbi/[\w/]+)', text))
    assert len(names) > 10
    wait_until(lambda: names <= {TARGETS, *viewer.channels, *viewer.services}, f"all of {names} are offered")


@pytest.mark.parametrize("example", ["basic_example_kuka_lwr", "world"])
def test_examples_start_the_bridge_if_asked(example):
    path = str(ROOT / f"src/rpbi_examples/launch/{example}.launch")
    given = ["headless:=true", *(["config:=world.yaml"] if example == "world" else [])]
    for wanted in ("true", "false"):
        loaded = load_config_default([(path, [*given, f"foxglove:={wanted}"])], None, assign_machines=False)
        assert ("foxglove_node.py" in {node.type for node in loaded.nodes}) == (wanted == "true")


def test_every_example_passes_the_argument_on():
    files = [path.read_text() for path in (ROOT / "src/rpbi_examples/launch").glob("*.launch")]
    with_simulator = [text for text in files if "/simulator.launch" in text]
    assert len(with_simulator) > 20 and all('<arg name="foxglove" default="false"' in text for text in with_simulator)
