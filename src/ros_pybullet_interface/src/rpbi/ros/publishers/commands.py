"""Publishes the description of a world and its commands, from which a recording can be replayed."""

import logging
from collections import deque
from collections.abc import Callable
from typing import Any

import rospy
from std_msgs.msg import String

from ros_pybullet_interface.msg import WorldCommand as WorldCommandMessage
from ros_pybullet_interface.msg import WorldCommands
from rpbi.ros.endpoints import Topic
from rpbi.ros.headers import to_ros_time
from rpbi.ros.state_topic import FastTopic
from rpbi.world import World
from rpbi.world.saved.command_log import WorldCommand
from rpbi.world.saved.values import to_text

log = logging.getLogger(__name__)

COMMANDS = Topic("rpbi/commands", WorldCommands, meaning="Commands to the world, by tick, for replays; as they come.")
DESCRIPTION = Topic("rpbi/world_description", String, meaning="The world as loaded, as JSON, for replays; latched.")
MAX_COMMANDS_PER_MESSAGE = 25
"""Largest number of commands in a message, so that building a message is fast; further ones follow in the next."""


class _Recipient:
    """A receiver of commands, and the index of the next command to send."""

    def __init__(self, send: Callable[[WorldCommands], None]) -> None:
        self.send = send
        self.next = 0


class _CommandTopic(FastTopic):
    """The topic `rpbi/commands`, with a list of subscribers to which all earlier commands must still be sent."""

    def __init__(self) -> None:
        self.newcomers: deque[_Recipient] = deque()
        super().__init__(COMMANDS.name, COMMANDS.message_type)

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Callable[[Any], None]) -> None:
        """Stores a new subscriber; rospy calls this method in another thread."""
        self.newcomers.append(_Recipient(peer_publish))


class CommandPublisher:
    """Publishes the description of a world once, and the world's commands in small messages, one per call of `spin`."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._topic = _CommandTopic()
        self._all = _Recipient(self._topic.publish)
        self._newcomers: list[_Recipient] = []
        self._description = rospy.Publisher(DESCRIPTION.name, String, queue_size=1, latch=True)
        self._description.publish(world.describe())
        self._resets = world.resets

    def spin(self) -> None:
        """Sends a message with new commands to all subscribers.

        Also sends a message with earlier commands to each new subscriber that does not have all commands yet.
        """
        commands, resets = self._world.commands, self._world.resets
        while self._topic.newcomers:
            self._newcomers.append(self._topic.newcomers.popleft())
        if resets != self._resets:
            self._resets = resets
            for reader in (self._all, *self._newcomers):
                reader.next = 0
        if commands.count != self._all.next:
            if self._topic.has_subscribers:
                self._send(self._all)
            else:
                self._all.next = commands.count
        for reader in self._newcomers:
            self._topic.wrap_connections()
            self._send(reader)
        self._newcomers = [reader for reader in self._newcomers if reader.next < commands.count]

    def catch_up(self) -> None:
        """Sends all commands that have not been sent yet to all subscribers."""
        self.spin()
        while self._all.next != self._world.commands.count:
            self.spin()

    def _send(self, reader: _Recipient) -> None:
        message = commands_message(self._world, reader.next)
        reader.next = message.first + len(message.commands)
        reader.send(message)


def commands_message(world: World, first: int) -> WorldCommands:
    """Returns a message with a world's commands from index `first` on, at most MAX_COMMANDS_PER_MESSAGE commands."""
    first, commands = world.commands.since(first, MAX_COMMANDS_PER_MESSAGE)
    message = WorldCommands(resets=world.resets, first=first, commands=[_message(each) for each in commands])
    message.header.stamp = to_ros_time(world.clock.stamp_ns)
    return message


def _message(command: WorldCommand) -> WorldCommandMessage:
    try:
        data = to_text(command.value)
    except TypeError as error:
        log.warning("%s: a command cannot be recorded, so replays will differ: %s", command.name, error)
        data = ""
    return WorldCommandMessage(command.tick, command.name, command.what, data)
