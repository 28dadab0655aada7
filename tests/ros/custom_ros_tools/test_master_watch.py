"""A node goes about its business without a master, and the master that comes back knows what has become of it."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from xmlrpc.server import SimpleXMLRPCServer

import pytest
import rosgraph
import rospy
import rospy.impl.registration
from ros_system import wait_until
from std_msgs.msg import Empty

from custom_ros_tools.ros.lifecycle.master_watch import Registrations

NODE = "/busy"
OWN = {("serves", f"{NODE}/{name}") for name in ("get_loggers", "set_logger_level")} | {("publishes", "/rosout")}
OLD = {("publishes", "/old"), ("subscribes", "/heard"), ("serves", "/old_too")} | OWN
NEW = {("publishes", "/new"), ("serves", "/new_too")} | OWN


@pytest.mark.thorough
@pytest.mark.parametrize("way", ["is killed", "hangs"])
def test_changes_while_the_master_is_away_are_registered_later(ros, tmp_path, second_master, way):
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
def test_master_lost_at_the_start_of_a_node_is_reported(ros, second_master):
    node = ros.start_program("loses_its_master.py", str(second_master.process.pid), **second_master.environment)
    assert node.wait(60.0) == 1
    said = ros.output(node)
    assert said.count("has gone while the node was starting") == 1 and "Traceback" not in said, said


@contextlib.contextmanager
def trial_publisher():
    """A publisher's node as the master reports it; yields its URI and the topics that it was asked for."""
    asked = []
    server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
    server.register_function(
        lambda caller, topic, protocols: (asked.append(topic), (0, "it was a trial", []))[1], "requestTopic"
    )
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}/", asked
    server.shutdown()
    server.server_close()


def test_a_publisher_that_comes_while_its_subscriber_registers_is_connected(ros, monkeypatch):
    """rospy would forget it if it is busy with another topic: the master's older answer comes last."""
    master, topic = rosgraph.Master("/late"), "/comes_meanwhile"
    on_answer = Registrations._on_answer
    with trial_publisher() as (uri, asked):

        def answer_late(self, kind, name, answer):
            assert (kind, name, answer[2]) == ("sub", topic, [])
            master.registerPublisher(topic, "std_msgs/Empty", uri)
            on_answer(self, kind, name, answer)

        monkeypatch.setattr(Registrations, "_on_answer", answer_late)
        subscriber = rospy.Subscriber(topic, Empty)
        monkeypatch.undo()
        try:
            wait_until(lambda: topic in asked, "the publisher is asked for the topic")
        finally:
            master.unregisterPublisher(topic, uri)
            subscriber.unregister()


def test_reports_of_publishers_may_overtake_each_other(ros):
    """rospy would connect to the publishers of the last report only."""
    topic = "/reported_late"
    manager = rospy.impl.registration.get_registration_listeners().listeners[0]._registry._rospys
    subscriber = rospy.Subscriber(topic, Empty)
    with trial_publisher() as (new, asked_new), trial_publisher() as (old, asked_old):
        with manager.cond:  # rospy's own thread gets to see both reports at once
            manager.publisher_update(topic, [new])
            manager.publisher_update(topic, [old])
        wait_until(lambda: topic in asked_new and topic in asked_old, "both publishers are asked for the topic")
    subscriber.unregister()


def test_a_lost_connection_is_made_again(ros):
    """rospy would take the ended connection for one that lives."""
    publisher = ros.start(["rostopic", "pub", "-r", "50", "/goes_on", "std_msgs/Empty"])
    received = ros.listen("/goes_on", Empty)
    received.wait_for(1)
    (connection,) = received._subscriber.impl.connections
    connection.close()
    count = len(received.messages)
    received.wait_for(count + 10)
    assert publisher.poll() is None
