"""What entered a world reaches every recorder, however many come at once and however slowly they read."""

from __future__ import annotations

import sys
import threading

import pytest
import rospy
from ros_system import wait_until
from tries import tries
from worlds import write_world

from custom_ros_tools.ros.buffered_socket import flush_buffered_sockets
from ros_pybullet_interface.msg import WorldCommands
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
