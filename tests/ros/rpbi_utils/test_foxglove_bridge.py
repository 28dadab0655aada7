"""The bridge to Foxglove at high rates, with viewers that are slow, wrong or hostile, and with unknown types."""

from __future__ import annotations

import random
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import genpy.dynamic
import pytest
import rosgraph
import rospy
from foxglove_bridge import FoxgloveBridge, publications, start_node, subscriptions
from foxglove_client import FoxgloveClient, StalledViewer, lost
from node_world import main_config, resident_mb
from ros_system import support_on_path, wait_until
from std_msgs.msg import Int32, String, UInt8MultiArray
from websockets.exceptions import ConnectionClosed
from workplace import Port
from worlds import iiwa

from ros_pybullet_interface.msg import SimulationState

STATES = "/rpbi/arm/joint_states"


@pytest.fixture(scope="module")
def bridge(module_ros) -> FoxgloveBridge:
    """The bridge next to a world with an arm."""
    arm = iiwa("arm", joint_state_publisher_hz=1000)
    module_ros.simulator(main_config(module_ros.folder, robots=(arm,), setAdditionalSearchPath="pybullet_data_path"))
    return FoxgloveBridge(module_ros)


@pytest.fixture
def topic(bridge) -> Iterator[rospy.Publisher]:
    publisher = rospy.Publisher("/told", String, queue_size=100)
    yield publisher
    publisher.unregister()


@pytest.fixture
def unharmed(bridge, topic) -> Iterator[None]:
    """Checks after a test that the world ticks, and that the bridge serves a viewer."""
    yield
    states = bridge.ros.listen("/rpbi/state", SimulationState)
    wait_until(lambda: len({each.tick for each in list(states.messages)}) > 1, "the world ticks")
    states.close()
    assert bridge.process.poll() is None
    with FoxgloveClient(bridge.port) as viewer:
        viewer.subscribe("/told")
        wait_until(lambda: topic.publish("still here") or viewer.messages["/told"], "a viewer is served")
    assert "Traceback" not in bridge.output, bridge.output


@pytest.mark.parametrize("count", [1000, pytest.param(60_000, marks=pytest.mark.thorough)])
def test_joint_states_of_1_khz_pass_with_equal_bytes(bridge, count):
    with FoxgloveClient(bridge.port) as viewer, FoxgloveClient(bridge.port) as other:
        other.subscribe(STATES, "/tf")
        seen, missing, changed = lost(bridge.ros, viewer, STATES, count)
        assert (missing, changed) == (0, 0) and seen >= count
        assert len(other.messages[STATES]) >= count


def test_comparison_finds_lost_and_changed_messages(bridge):
    """Negative control of `lost`."""
    with FoxgloveClient(bridge.port) as viewer:
        viewer.messages[STATES] = _Faulty()
        seen, missing, changed = lost(bridge.ros, viewer, STATES, 100)
    assert seen >= 100 and (missing, changed) == (1, 1)


class _Faulty(list):
    """Loses the tenth message, and changes the eleventh."""

    seen = 0

    def append(self, item: tuple[int, bytes]) -> None:
        self.seen += 1
        if self.seen == 11:
            item = (item[0], item[1][:-1] + bytes([item[1][-1] ^ 1]))
        if self.seen != 10:
            super().append(item)


def test_messages_that_do_not_fit_their_type_are_left_out(bridge, unharmed):
    heard = bridge.ros.listen("/heard", Int32)
    with FoxgloveClient(bridge.port) as viewer:
        channel = viewer.advertise("/heard", "std_msgs/Int32")
        for data in (b"", b"\x01"):
            viewer.publish(channel, data)
        wait_until(lambda: viewer.publish(channel, b"\x01\x00\x00\x00") or heard.messages, "the right one comes")
        assert {each.data for each in heard.messages} == {1}
    assert bridge.lines("/heard: message left out: it is no std_msgs/Int32") == 1
    heard.close()


@pytest.mark.parametrize(
    ("topic_name", "type_name", "encoding", "message"),
    [
        ("/a", "std_msgs/Int32", "json", "expected encoding ros1, got json"),
        ("/b", "no_such_msgs/Int32", "ros1", "type no_such_msgs/Int32 is not installed"),
        ("/c", "antigravity/Int32", "ros1", "type antigravity/Int32 is not installed"),
        ("/d", "../../etc/passwd", "ros1", "type ../../etc/passwd is not installed"),
        ("<script>alert(1)</script>", "std_msgs/Int32", "ros1", "this is no name of a ROS topic"),
        ("/" + "x" * 5000, "std_msgs/" + "y" * 5000, "ros1", "type std_msgs/yyyy"),
    ],
    ids=["encoding", "unknown package", "python module", "path", "markup", "long names"],
)
def test_wrong_announcements_are_refused_in_one_line(bridge, topic_name, type_name, encoding, message):
    before = set(rosgraph.Master("/tests").getTopicTypes()[0])
    with FoxgloveClient(bridge.port) as viewer:
        channel = viewer.advertise(topic_name, type_name, encoding)
        viewer.publish(channel, b"{}")
        assert bridge.lines(message) == 1
    (log,) = bridge.rosout.logs(message)
    assert len(log.msg) < 300 and "\n" not in log.msg
    assert before == set(rosgraph.Master("/tests").getTopicTypes()[0])


def test_garbage_does_not_harm(bridge, unharmed):
    frames: list[Any] = [
        b"",
        b"\x01",
        b"\x02\xff\xff\xff\xff",
        b"\xff" * 100,
        struct.pack("<BIII", 2, 1, 1, 0xFFFFFFFF),
        struct.pack("<BI", 1, 99) + b"data",
        "{",
        "null",
        "[]",
        '{"op": "no such"}',
        '{"op": "subscribe"}',
        '{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1e99}]}',
        '{"op": "setParameters", "parameters": [{"name": "/", "value": 1}, {"name": "<b>", "value": 2}]}',
        '{"op": "advertise", "channels": [{"id": 1, "topic": null}]}',
        '{"op": "' + "x" * 100_000 + '"}',
        "[" * 100_000,
    ]
    distribution = rospy.get_param("/rosdistro")
    for frame in frames:
        with FoxgloveClient(bridge.port) as viewer:
            viewer.send_text(frame) if isinstance(frame, str) else viewer.send_bytes(frame)
            viewer.get_parameters("/rosdistro")
    assert rospy.get_param("/rosdistro") == distribution
    with socket.create_connection(("127.0.0.1", bridge.port)) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\n\r\n" + b"\0" * 10_000)


@pytest.mark.thorough
def test_message_of_100_megabytes_is_refused(bridge, unharmed):
    heard = bridge.ros.listen("/large", UInt8MultiArray)
    with FoxgloveClient(bridge.port) as viewer:
        channel = viewer.advertise("/large", "std_msgs/UInt8MultiArray")
        before_mb = resident_mb(bridge.process.pid)
        with suppress(ConnectionError, ConnectionClosed):
            viewer.publish(channel, bytes(100_000_000))
        wait_until(lambda: viewer.is_closed, "the viewer is disconnected")
    assert not heard.messages and resident_mb(bridge.process.pid) < before_mb + 150
    heard.close()


@pytest.mark.thorough
def test_million_subscriptions_do_not_harm(bridge, unharmed):
    before_mb = resident_mb(bridge.process.pid)
    with FoxgloveClient(bridge.port) as viewer:
        for first in range(0, 1_000_000, 50_000):
            wanted = [{"id": each, "channelId": each} for each in range(first, first + 50_000)]
            try:
                viewer.op("subscribe", subscriptions=wanted)
                viewer.op(
                    "subscribeParameterUpdates", parameterNames=[f"/{each}" for each in range(first, first + 5000)]
                )
            except Exception:
                break
    assert resident_mb(bridge.process.pid) < before_mb + 300


@pytest.mark.thorough
def test_viewer_that_announces_many_topics_is_limited(bridge, unharmed):
    with FoxgloveClient(bridge.port) as viewer:
        for number in range(300):
            viewer.advertise(f"/many/{number}", "std_msgs/Int32")
        assert bridge.lines("viewers have more than 100 topics") >= 1
        assert sum(name.startswith("/many") for name in publications()) <= 100
        viewer.op("unadvertise", channelIds=list(range(1000)))


def test_flood_of_messages_is_limited(bridge, unharmed, topic):
    heard = bridge.ros.listen("/flooded", Int32)
    sent = 0
    with FoxgloveClient(bridge.port) as flooder, FoxgloveClient(bridge.port) as viewer:
        viewer.subscribe("/told")
        channel = flooder.advertise("/flooded", "std_msgs/Int32")

        def is_limited() -> list[Any]:
            """Floods; a busy computer may be too slow for it at first."""
            nonlocal sent
            for _ in range(10_000):
                flooder.publish(channel, b"\x01\x00\x00\x00")
            sent += 10_000
            return bridge.rosout.logs("messages left out: more than 2000 in a second")

        wait_until(is_limited, "messages are left out")
        wait_until(lambda: topic.publish("x") or viewer.messages["/told"], "another viewer is served")
    assert 0 < len(heard.messages) < sent
    heard.close()


def test_slow_viewer_loses_only_its_own(bridge, unharmed):
    publisher = rospy.Publisher("/large_images", UInt8MultiArray, queue_size=100)
    with FoxgloveClient(bridge.port) as viewer, stalled_viewer(bridge, viewer, "/large_images"):
        viewer.subscribe("/large_images")
        wait_until(
            lambda: publisher.publish(UInt8MultiArray()) or viewer.messages["/large_images"], "the bridge listens"
        )
        for number in range(40):
            publisher.publish(UInt8MultiArray(data=bytes([number]) * 1_000_000))
            time.sleep(0.01)

        def taken() -> list[int]:
            return [data[-1] for _, data in list(viewer.messages["/large_images"]) if len(data) > 1_000_000]

        wait_until(lambda: len(taken()) >= 40, "the other viewer has all")
    assert taken() == list(range(40))
    publisher.unregister()


@pytest.mark.thorough
def test_memory_for_a_viewer_that_takes_nothing_is_limited(bridge, unharmed):
    publisher = rospy.Publisher("/large_images", UInt8MultiArray, queue_size=100)
    with FoxgloveClient(bridge.port) as viewer:
        with stalled_viewer(bridge, viewer, "/large_images"):
            wait_until(publisher.get_num_connections, "the bridge listens")
            before_mb = resident_mb(bridge.process.pid)
            for _ in range(500):
                publisher.publish(UInt8MultiArray(data=bytes(1_000_000)))
                time.sleep(0.02)
            assert 100 < resident_mb(bridge.process.pid) - before_mb < 350
        wait_until(lambda: "/large_images" not in subscriptions(), "it is not served any more")
        wait_until(lambda: resident_mb(bridge.process.pid) < before_mb + 60, "its messages are freed")
    publisher.unregister()


@contextmanager
def stalled_viewer(bridge: FoxgloveBridge, viewer: FoxgloveClient, name: str) -> Iterator[None]:
    wait_until(lambda: name in viewer.channels, f"{name} is offered")
    stalled = StalledViewer(bridge.port, viewer.channels[name]["id"])
    yield
    stalled.close()


@pytest.mark.thorough
def test_viewers_that_come_and_leave_do_not_block_the_bridge(bridge, unharmed):
    """With the log of foxglove-sdk, threads waited for each other forever."""
    end_s = time.monotonic() + 15.0
    done: list[int] = []

    def come_and_leave(seed: int) -> None:
        chance = random.Random(seed)
        while time.monotonic() < end_s:
            with suppress(ConnectionClosed), FoxgloveClient(bridge.port) as viewer:
                for _ in range(10):
                    viewer.subscribe(STATES, "/rpbi/state")
                    viewer.publish(viewer.advertise(f"/many/{chance.randrange(5)}", "std_msgs/Int32"), bytes(4))
                    viewer.op("subscribeParameterUpdates", parameterNames=["/a"])
                    viewer.op("setParameters", parameters=[{"name": "/a", "value": chance.random()}], id="a")
                    wrong = [{"id": 1000 + each, "channelId": 10**6 + each} for each in range(10)]
                    viewer.op("subscribe", subscriptions=wrong)
                    viewer.unsubscribe(STATES)
                    viewer.unsubscribe("/rpbi/state")
                    done.append(seed)

    threads = [threading.Thread(target=come_and_leave, args=(seed,), daemon=True) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(120.0)
    assert not any(thread.is_alive() for thread in threads) and len(done) > 40
    rospy.delete_param("/a")


def test_topic_of_a_type_that_is_not_installed_is_shown(bridge):
    (message_class,) = genpy.dynamic.generate_dynamic("lab_msgs/Reading", "float64 value\nstring unit\n").values()
    publisher = rospy.Publisher("/reading", message_class, queue_size=10)
    with FoxgloveClient(bridge.port) as viewer:
        wait_until(lambda: "/reading" in viewer.channels, "it is offered")
        assert viewer.channels["/reading"]["schema"].startswith("float64 value\nstring unit\n")
        assert "/reading" not in subscriptions()
        viewer.subscribe("/reading")
        message = message_class(1.5, "m")
        wait_until(lambda: publisher.publish(message) or viewer.messages["/reading"], "it comes")
        assert viewer.messages["/reading"][0][1] == struct.pack("<dI", 1.5, 1) + b"m"
    publisher.unregister()


def test_definition_of_the_publisher_replaces_an_installed_one(bridge):
    (message_class,) = genpy.dynamic.generate_dynamic("std_msgs/Int32", "int32 data\nstring unit\n").values()
    publisher = rospy.Publisher("/other_int32", message_class, queue_size=10, latch=True)
    publisher.publish(message_class(7, "m"))
    with FoxgloveClient(bridge.port) as viewer:
        viewer.subscribe("/other_int32")
        wait_until(lambda: "string unit" in viewer.channels.get("/other_int32", {}).get("schema", ""), "it is replaced")
        viewer.subscribe("/other_int32")
        wait_until(lambda: viewer.messages["/other_int32"], "it comes")
        assert viewer.messages["/other_int32"][0][1] == struct.pack("<iI", 7, 1) + b"m"
    publisher.unregister()


def test_topic_whose_publisher_has_died_is_named_in_one_line(bridge):
    master = rosgraph.Master("/dead")
    master.registerPublisher("/orphan<b>", "lab_msgs/Unknown", "http://127.0.0.1:1")
    assert bridge.lines("/orphan<b>: not shown: its type lab_msgs/Unknown is not installed") == 1
    master.unregisterPublisher("/orphan<b>", "http://127.0.0.1:1")


def test_names_with_html_are_passed_on_as_text(bridge):
    master = rosgraph.Master("/html")
    master.registerPublisher("/<b>bold</b>", "std_msgs/Int32", "http://127.0.0.1:1")
    with FoxgloveClient(bridge.port) as viewer:
        wait_until(lambda: "/<b>bold</b>" in viewer.channels, "it is offered")
    master.unregisterPublisher("/<b>bold</b>", "http://127.0.0.1:1")


def test_second_bridge_on_the_port_ends_in_one_line(bridge):
    second = start_node(bridge.ros, bridge.port)
    assert second.wait(60.0) == 1
    said = bridge.ros.output(second)
    assert len(said.splitlines()) == 1 and f"port {bridge.port} of 127.0.0.1 is in use" in said


@pytest.mark.thorough
def test_second_bridge_on_another_port_serves_too(bridge, topic):
    port = Port()
    second = start_node(bridge.ros, port.number, "__name:=second_bridge")
    wait_until(lambda: "can connect to" in bridge.ros.output(second), "the second bridge is up")
    with FoxgloveClient(port.number) as viewer:
        viewer.subscribe("/told")
        wait_until(lambda: topic.publish("x") or viewer.messages["/told"], "it serves")
    assert second.poll() is None


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        pytest.param(
            ["--host", "no.such.host.invalid"],
            "cannot listen at no.such.host.invalid",
            marks=pytest.mark.thorough,
        ),
        (["--host", "192.0.2.1"], "cannot listen at 192.0.2.1"),
    ],
)
def test_wrong_address_ends_in_one_line(bridge, arguments, told):
    wrong = start_node(bridge.ros, Port().number, *arguments)
    assert wrong.wait(60.0) == 1
    said = bridge.ros.output(wrong)
    assert len(said.splitlines()) == 1 and told in said


@pytest.mark.thorough
def test_missing_extra_is_named_in_one_line(bridge, tmp_path):
    (tmp_path / "foxglove.py").write_text("raise ImportError\n")
    modules = f"{tmp_path}:{support_on_path()['PYTHONPATH']}"
    node = start_node(bridge.ros, Port().number, PYTHONPATH=modules)
    assert node.wait(60.0) == 1
    assert bridge.ros.output(node).splitlines() == ["foxglove: 'foxglove-sdk' is not installed: ./rpbi setup foxglove"]


def test_only_this_computer_is_served_unless_asked(bridge):
    listening = [line.split()[1] for line in Path("/proc/net/tcp").read_text().splitlines()[1:] if " 0A " in line]
    assert f"0100007F:{bridge.port:04X}" in listening and f"00000000:{bridge.port:04X}" not in listening
