"""A ROS master that goes away and comes back finds every node again, as if nothing had been."""

from __future__ import annotations

import os
import signal
from contextlib import contextmanager
from xmlrpc.client import ServerProxy

import pytest
from node_world import main_config
from ros_system import LimitedTransport, wait_until
from worlds import FLOOR, iiwa

from rpbi.ros.cameras.topics import camera_topics

NODE = "/ros_pybullet_interface"
CAMERA_NODE = f"{NODE}_camera"
REMAP_NODE = "/remap_joint_state_to_floatarray"
JOINT_STATES = "/rpbi/iiwa/joint_states"
DESCRIPTION = "/rpbi/iiwa/robot_description"
CAMERA = {"name": "camera", "object_tf": {"tf_id": "camera"}, "intrinsics": {"width": 64, "height": 48}}
GONE = "cannot be reached"
BACK = "is back"
TAKEN = f"another node has taken the name {NODE} (at"


def _start(ros, master, folder, **more):
    robot = iiwa(joint_state_publisher_hz=100)
    config = main_config(folder, collision=(FLOOR,), robots=(robot,), **more)
    master.api.setParam(f"{NODE}/config", config)
    process = ros.simulator({}, wait=False, **master.environment)
    wait_until(lambda: master.has("/rpbi/get_state_hash"), "the simulator is up")
    return process


def _command(ros, master, *command):
    return ros.start(command, **master.environment)


def _wait_for(ros, process, text, count=1):
    wait_until(lambda: ros.output(process).count(text) >= count, f"'{text}' is said {count} times")


@contextmanager
def _frozen(process):
    """A process that does not notice what happens meanwhile."""
    os.killpg(process.pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.killpg(process.pid, signal.SIGCONT)


def test_everybody_is_found_again_and_connections_last(ros, tmp_path, second_master):
    master = second_master
    master.api.setParam("/use_sim_time", True)
    simulator = _start(ros, master, tmp_path, rgbd_sensor=CAMERA)
    master.api.setParam(f"{REMAP_NODE}/start_on_init", True)
    remap_command = ["rosrun", "custom_ros_tools", "remap_joint_state_to_floatarray", f"joint_states:={JOINT_STATES}"]
    remap = _command(ros, master, *remap_command)
    nodes = (NODE, CAMERA_NODE, REMAP_NODE)
    images = {("publishes", f"/{name}") for name in camera_topics("camera", pointcloud=False)}
    wait_until(lambda: images <= set(master.registrations(CAMERA_NODE)), "the camera is up")
    toggles = {("serves", f"{REMAP_NODE}/toggle"), ("serves", "/remap_joint_state/toggle")}  # opened last
    wait_until(lambda: toggles <= set(master.registrations(REMAP_NODE)), "it listens")
    wait_until(lambda: len(_connected(master, JOINT_STATES)) == 1, "they are connected")
    before = {node: master.registrations(node) for node in nodes}
    connections = _connected(master, JOINT_STATES)
    names = sorted(name for name in master.api.getParamNames() if name.startswith(("/use_sim_time", NODE, "/rpbi")))

    master.kill()
    _wait_for(ros, simulator, GONE, 2)  # the camera's node says so too
    _wait_for(ros, remap, GONE)
    master.start()
    for node in nodes:
        wait_until(lambda node=node: master.registrations(node) == before[node], f"{node} has all that it had")
    _wait_for(ros, simulator, BACK)  # what a camera says, other than warnings, is in /rosout only
    _wait_for(ros, remap, BACK)
    assert set(names) <= set(master.api.getParamNames())
    assert master.api.getParam("/use_sim_time") is True

    visitor = ros.start_program("visitor.py", **master.environment)
    assert visitor.wait(120.0) == 0, ros.output(visitor)
    said = ros.output(visitor)
    assert "moved" in said and "slept until" in said and "stopped" in said and "tick " in said, said
    wait_until(lambda: _connected(master, JOINT_STATES) == connections, "the old connection is there, once")
    # Of a master that takes two seconds to answer it is said too
    wait_until(lambda: _times_gone(ros, simulator) == ros.output(simulator).count(BACK), "it is said once each time")


def _times_gone(ros, simulator):
    """Returns how often a simulator itself has said that the master is gone; its camera says so too."""
    return sum(
        GONE in line and f"{NODE} keeps its existing connections" in line for line in ros.output(simulator).splitlines()
    )


def _connected(master, topic):
    """Returns the connections to who listens to a topic of the simulator, as (number, node)."""
    _, _, connections = ServerProxy(master.api.lookupNode(NODE), LimitedTransport()).getBusInfo("/tests")
    return [(number, other) for number, other, way, _, name, *_ in connections if name == topic and way == "o"]


@pytest.mark.thorough
def test_paused_world_registers_again_after_each_return_of_the_master(ros, tmp_path, second_master):
    master = second_master
    simulator = _start(ros, master, tmp_path, start_pybullet_after_initialization=False)
    before = master.registrations(NODE)
    description = master.api.getParam(DESCRIPTION)
    waiting = _command(ros, master, "rosservice", "call", "/rpbi/step_n", "1000000")
    wait_until(lambda: "the simulation is stepping" in _call(ros, master, "step"), "it steps")
    master.kill()
    _wait_for(ros, simulator, GONE)
    master.start()
    _wait_for(ros, simulator, BACK)
    wait_until(lambda: master.registrations(NODE) == before, "it has all that it had")
    assert master.api.getParam(DESCRIPTION) == description
    with _frozen(simulator):  # so that it does not see that the master is away for a moment
        master.kill()
        master.start()
        master.api.setParam(DESCRIPTION, "somebody else's by now")
    _wait_for(ros, simulator, BACK, 2)
    wait_until(lambda: master.registrations(NODE) == before, "it has all that it had again")
    assert master.api.getParam(DESCRIPTION) == "somebody else's by now"
    assert "stopped" in _call(ros, master, "stop")
    assert waiting.wait(60.0) == 0, "it has waited all the time"
    assert "stopped after" in ros.output(waiting), ros.output(waiting)


def _call(ros, master, service):
    """Calls a service in another process, since this one has another master."""
    process = _command(ros, master, "rosservice", "call", f"/rpbi/{service}")
    process.wait(60.0)
    return ros.output(process)


def test_the_newer_one_of_two_nodes_of_a_name_stays(ros, tmp_path, second_master):
    master = second_master
    simulator = _start(ros, master, tmp_path)
    with _frozen(simulator):
        master.kill()
        master.start()
        newer = ServerProxy(master.uri)
        for topic, message_type in (("/rosout", "rosgraph_msgs/Log"), ("/somewhere", "std_msgs/Empty")):
            newer.registerPublisher(NODE, topic, message_type, "http://127.0.0.1:1/")
    assert simulator.wait(60.0) == 0, ros.output(simulator)
    said = ros.output(simulator)
    assert said.count(TAKEN) == 1 and BACK not in said and "Traceback" not in said, said
    assert master.api.lookupNode(NODE) == "http://127.0.0.1:1/"
    assert master.registrations(NODE) == [("publishes", "/rosout"), ("publishes", "/somewhere")]
