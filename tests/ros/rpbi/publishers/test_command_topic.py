"""What entered a world reaches every recorder, however many come at once and however slowly they read."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time

import pytest
import rospy
from node_world import main_config, publishing
from ros_system import wait_until
from sensor_msgs.msg import JointState
from tries import tries
from worlds import iiwa, write_world

from custom_ros_tools.sockets import flush_buffered_sockets
from ros_pybullet_interface.msg import SimulationState, WorldCommands
from rpbi.ros.publishers.commands import CommandPublisher
from rpbi.world import World
from rpbi.world.saved.command_log import WorldCommand


@pytest.fixture
def world(tmp_path):
    world = World.from_file(write_world(tmp_path))
    yield world
    world.close()


@pytest.fixture
def publisher(ros, world):
    publisher = CommandPublisher(world)
    yield publisher
    publisher._topic.close()
    publisher._description.unregister()


@pytest.mark.quick
def test_none_of_many_newcomers_at_once_is_lost(world, publisher):
    world.commands.note(WorldCommand(0, "", "halt", "a test"))
    told = []

    def come(first):
        for number in range(first, first + 1000):  # as rospy's own threads do
            publisher._topic.peer_subscribe("/rpbi/commands", None, lambda message, number=number: told.append(number))

    threads = [threading.Thread(target=come, args=(first,)) for first in (0, 1000, 2000, 3000)]
    interval_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        for thread in threads:
            thread.start()
        for _ in tries("all have come"):
            publisher.spin()
            if not any(thread.is_alive() for thread in threads):
                break
    finally:
        sys.setswitchinterval(interval_s)
    publisher.spin()
    assert sorted(told) == list(range(4000))


def test_who_was_slow_gets_the_rest_though_nothing_new_comes(world, publisher):
    reads = threading.Event()
    got = set()

    def on_message(message):
        reads.wait(60.0)
        got.update(range(message.first, message.first + len(message.commands)))

    subscriber = rospy.Subscriber("/rpbi/commands", WorldCommands, on_message)
    try:
        wait_until(lambda: publisher.spin() or publisher._topic.has_subscribers, "it is connected")
        for tick in range(200):
            world.commands.note(WorldCommand(tick, "", "halt", "x" * 200_000))  # together more than sockets hold
        for _ in range(20):
            publisher.spin()
        reads.set()
        wait_until(lambda: flush_buffered_sockets() or len(got) == 200, "it has all")
    finally:
        reads.set()
        subscriber.unregister()


@pytest.mark.thorough
def test_recording_cut_anywhere_contains_the_commands_of_its_last_hash(ros, tmp_path):
    simulator = ros.simulator(main_config(tmp_path, robots=(iiwa(),), state_hash_hz=500.0), use_sim_time=True)
    states, commands = ros.listen("/rpbi/state", SimulationState), ros.listen("/rpbi/commands", WorldCommands)
    with publishing("/rpbi/iiwa/joint_states/target", JointState) as targets:
        for turn in range(40):
            for step in range(100):
                targets.publish(JointState(name=["lbr_iiwa_joint_2"], position=[0.001 * (turn + step)]))
                time.sleep(0.0005)
            os.killpg(simulator.pid, signal.SIGSTOP)
            try:
                _wait_until_quiet(states, commands)
                hashed = [each.commands for each in states.messages if each.state_hash]
                known = [each.first + len(each.commands) for each in commands.messages]
                assert not known or hashed[-1] <= max(known), f"stop {turn}"
            finally:
                os.killpg(simulator.pid, signal.SIGCONT)
    assert max(known) > 200 and hashed[-1] > 200


def _wait_until_quiet(*listeners):
    """Waits until all that was sent has come."""
    before = None
    while before != (before := [len(each.messages) for each in listeners]):
        time.sleep(0.1)


def test_a_running_simulator_makes_keyframes(ros, tmp_path):
    ros.simulator(main_config(tmp_path, robots=(iiwa(),), keyframe_every_s=0.2), use_sim_time=True)
    commands = []
    subscriber = rospy.Subscriber("/rpbi/commands", WorldCommands, lambda message: commands.extend(message.commands))
    wait_until(lambda: [each.what for each in commands].count("keyframe") > 1, "two keyframes")
    subscriber.unregister()
    first, second, *_ = [each for each in commands if each.what == "keyframe"]
    assert second.tick > first.tick >= 200 and len(second.data) > 1000
