"""A node whose output cannot be written; the end of a node: what it says, and what the master still knows of it."""

import os
import signal
import sys

import pytest
import rosgraph
from ros_system import SUPPORT, support_on_path, wait_until
from rosgraph_msgs.msg import Log
from std_msgs.msg import Empty


@pytest.mark.parametrize("interrupted", [True, False], ids=["both are interrupted", "the other node dies"])
def test_lost_service_node_is_reported_unless_both_are_interrupted(ros, interrupted):
    server, client = (ros.start_program("calls_a_service.py", role, role) for role in ("serve", "call"))
    wait_until(lambda: "asked" in ros.output(server), "the service is called")
    if interrupted:
        os.killpg(client.pid, signal.SIGINT)
    os.killpg(server.pid, signal.SIGKILL)
    assert client.wait(60.0) == (0 if interrupted else 1)
    said = ros.output(client)
    assert "Traceback" not in said, said
    assert ("its node has gone" in said) != interrupted, said


def test_the_master_knows_nothing_of_a_node_that_has_ended(ros):
    node = ros.start_program("calls_a_service.py", "serve", "leaver")
    master = rosgraph.Master("/test")
    wait_until(lambda: "/leaver" in dict(master.getSystemState()[2]).get("/never_answers", ()), "the node is up")
    assert master.lookupNode("/leaver")
    wait_until(lambda: "takes" in ros.output(node), "a callback is about to publish")
    os.killpg(node.pid, signal.SIGINT)
    assert node.wait(60.0) == 0, ros.output(node)
    assert "bad callback" not in ros.output(node)
    with pytest.raises(rosgraph.MasterError, match="unknown node"):
        master.lookupNode("/leaver")


def test_interrupted_node_ends_quietly_while_it_publishes(ros):
    node = ros.start_program("publishes_to_its_end.py")
    ros.listen("/beats", Empty).wait_for(1)
    os.killpg(node.pid, signal.SIGINT)
    assert node.wait(60.0) == 0, ros.output(node)
    assert "Traceback" not in ros.output(node)


def test_node_continues_when_its_output_is_on_a_full_disk(ros):
    beats, logged = ros.listen("/beats", Empty), ros.listen("/rosout", Log)
    program = SUPPORT / "programs/warns_often.py"
    ros.start(["bash", "-c", f"exec {sys.executable} {program} > /dev/full 2>&1"], **support_on_path())
    beats.wait_for(10)
    wait_until(lambda: any(each.name == "/warns_often" for each in logged.messages), "a warning in /rosout")
