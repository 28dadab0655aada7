"""A node goes about its business without a master, and the master that comes back knows what has become of it."""

from __future__ import annotations

import os
import signal
import threading
from xmlrpc.server import SimpleXMLRPCServer

import pytest
import rosgraph
import rospy
from ros_system import wait_until
from std_msgs.msg import Empty

from custom_ros_tools.ros.lifecycle.master_watch import Registrations

NODE = "/busy"
OWN = {("serves", f"{NODE}/{name}") for name in ("get_loggers", "set_logger_level")} | {("publishes", "/rosout")}
OLD = {("publishes", "/old"), ("subscribes", "/heard"), ("serves", "/old_too")} | OWN
NEW = {("publishes", "/new"), ("serves", "/new_too")} | OWN


@pytest.mark.parametrize("way", ["is killed", "hangs"])
def test_what_is_opened_and_closed_while_the_master_is_away(ros, tmp_path, second_master, way):
    sign = tmp_path / "now"
    node = ros.start_program("busy_without_master.py", str(sign), **second_master.environment)
    wait_until(lambda: "ready" in ros.output(node), "the node is up")
    wait_until(lambda: set(second_master.registrations(NODE)) == OLD, "the master knows it")
    assert second_master.api.getParam("/old_parameter") == 1
    if way == "hangs":
        os.killpg(second_master.process.pid, signal.SIGSTOP)
    else:
        second_master.kill()
    try:
        wait_until(lambda: "cannot be reached" in ros.output(node), "the node misses it")
        sign.touch()
        wait_until(lambda: "done" in ros.output(node), "the node waits for nobody")
        assert ros.output(node).count("cannot be reached") == 1
    finally:
        if way == "hangs":
            os.killpg(second_master.process.pid, signal.SIGCONT)
        else:
            second_master.start()
    wait_until(lambda: set(second_master.registrations(NODE)) == NEW, "the master knows what has become of it")
    names = second_master.api.getParamNames()
    assert "/new_parameter" in names
    assert way == "hangs" or "/old_parameter" not in names


@pytest.mark.quick
def test_a_master_that_ends_while_a_node_starts_is_told_in_one_line(ros, second_master):
    node = ros.start_program("loses_its_master.py", str(second_master.process.pid), **second_master.environment)
    assert node.wait(60.0) == 1
    said = ros.output(node)
    assert said.count("has gone while the node was starting") == 1 and "Traceback" not in said, said


def test_a_publisher_that_comes_while_its_subscriber_registers_is_connected(ros, monkeypatch):
    """rospy would forget it if it is busy with another topic: the master's older answer comes last."""
    asked = []
    server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
    server.register_function(
        lambda caller, topic, protocols: (asked.append(topic), (0, "it was a trial", []))[1], "requestTopic"
    )
    threading.Thread(target=server.serve_forever, daemon=True).start()
    uri = f"http://127.0.0.1:{server.server_address[1]}/"
    master, topic = rosgraph.Master("/late"), "/comes_meanwhile"
    take = Registrations._on_answer

    def take_late(self, kind, name, answer):
        assert (kind, name, answer[2]) == ("sub", topic, [])
        rospys = self._registry._rospys
        rospys.publisher_update("/another", [])
        wait_until(lambda: not rospys.updates, "rospy waits for the topics, which are locked now")
        master.registerPublisher(topic, "std_msgs/Empty", uri)
        wait_until(lambda: (topic, [uri]) in rospys.updates, "the master has told of the publisher")
        take(self, kind, name, answer)

    monkeypatch.setattr(Registrations, "_on_answer", take_late)
    subscriber = rospy.Subscriber(topic, Empty)
    monkeypatch.undo()
    try:
        wait_until(lambda: topic in asked, "the publisher is asked for the topic")
    finally:
        master.unregisterPublisher(topic, uri)
        subscriber.unregister()
        server.shutdown()
        server.server_close()
