"""The node `record_node.py`, which records episodes. Services, keys and joystick buttons control the node."""

from __future__ import annotations

import json
import logging
import os
import re
import threading
import time
from collections.abc import Callable, Mapping
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TypeVar

import genpy
import rosbag
import rosgraph
import rospy
from cob_srvs.srv import SetString, SetStringRequest, SetStringResponse
from keyboard.msg import Key
from sensor_msgs.msg import Joy
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.key_down_subscriber import KeyDownSubscriber
from custom_ros_tools.ros.lifecycle.parameters import private_parameters
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.lifecycle.wall_time import WallTimer
from ros_pybullet_interface.msg import SimulationState, WorldCommands
from rpbi_data.bags.limits import BagError
from rpbi_data.bags.recorded_topics import Recorder

from .bags import measure_topics, repair, repair_all
from .config import RecordParameters
from .errors import EpisodeError
from .facts import checked_label
from .files import files_of_world, store_files
from .folder import BAG, EARLIER, Episode, EpisodeFolder, git_state, hold, versions, write_facts
from .listing import clock_note

CHECK_HZ = 1.0
"""Rate at which the disk and the recorder are checked, and the status is published [Hz]."""
MAX_HASH_WAIT_S = 1.5
"""Longest time to wait for a state hash at the end of an episode [s]."""
MAX_LOCK_WAIT_S = 1.0
"""Longest time to wait for the lock of a new episode, which a listing of episodes may hold for a moment [s]."""
MAX_RESET_WAIT_S = 10.0
"""Longest time to wait for the state after a reset [s]."""
POLL_S = 0.01
KEPT_COMMANDS = 4_000
"""Number of commands since a reset above which all of them are also stored in a file.

The simulator resends at most 5,000 earlier commands to a new subscriber.
"""

_Trigger = TypeVar("_Trigger", str, int)
_log = logging.getLogger(__name__)


class _Simulator:
    """Receives the simulator's description, states and commands, which a replay of an episode needs."""

    def __init__(self, namespace: str) -> None:
        self._prefix = f"/{namespace.strip('/')}/" if namespace.strip("/") else "/"
        self._lock = threading.Lock()
        self._commands: dict[int, WorldCommands] = {}
        self._resets = 0
        self.description = ""
        self.state: SimulationState | None = None
        self.hashes = 0
        rospy.Subscriber(f"{self._prefix}rpbi/world_description", String, self._on_description)
        rospy.Subscriber(f"{self._prefix}rpbi/state", SimulationState, self._on_state)
        rospy.Subscriber(f"{self._prefix}rpbi/commands", WorldCommands, self._on_commands, tcp_nodelay=True)

    @property
    def commands_topic(self) -> str:
        """Full name of the topic `rpbi/commands`."""
        return f"{self._prefix}rpbi/commands"

    def reset(self) -> None:
        """Resets the world, and waits for the first state after the reset; raises an InterfaceError if either fails."""
        before = self.state.resets if self.state else 0
        service = f"{self._prefix}rpbi/reset"
        try:
            rospy.wait_for_service(service, MAX_RESET_WAIT_S)
            answer = rospy.ServiceProxy(service, Trigger)()
        except (rospy.ROSException, rospy.ServiceException) as error:
            raise InterfaceError(f"{service}: {error}") from error
        if not answer.success:
            raise InterfaceError(f"{service}: {answer.message}")
        deadline = time.monotonic() + MAX_RESET_WAIT_S
        while self.state is None or self.state.resets == before:
            if time.monotonic() > deadline:
                raise InterfaceError(f"no {self._prefix}rpbi/state after the reset within {MAX_RESET_WAIT_S:g} s")
            time.sleep(POLL_S)

    def wait_for_hash(self) -> None:
        """Waits for the next state hash of a running world, so that the end of an episode can be verified."""
        before, deadline = self.hashes, time.monotonic() + MAX_HASH_WAIT_S
        while self.state is not None and self.state.running and self.hashes == before:
            if time.monotonic() > deadline:
                return
            time.sleep(POLL_S)

    def write_commands(self, path: Path) -> str:
        """Writes all commands since the world was built or reset to a bag, if there are at least `KEPT_COMMANDS`.

        Returns:
            A message if this node did not receive the first commands; otherwise an empty text.
        """
        with self._lock:
            messages = [self._commands[first] for first in sorted(self._commands)]
        if not messages or messages[-1].first + len(messages[-1].commands) < KEPT_COMMANDS:
            return ""
        with rosbag.Bag(str(path), "w", compression="lz4") as bag:
            for message in messages:
                bag.write(self.commands_topic, message, message.header.stamp or genpy.Time(0, 1))
        missing = messages[0].first
        return f"cannot be verified: {missing} commands came before this node was started" if missing else ""

    def _on_description(self, message: String) -> None:
        with self._lock:
            self.description = message.data
            self._commands.clear()
            self._resets = 0

    def _on_state(self, message: SimulationState) -> None:
        self.state = message
        self.hashes += bool(message.state_hash)

    def _on_commands(self, message: WorldCommands) -> None:
        with self._lock:
            if message.resets != self._resets:
                self._commands.clear()
                self._resets = message.resets
            self._commands[message.first] = message


class RecordNode:
    """Records episodes into a folder. The node's parameters are described in `RecordParameters`.

    Raises:
        ConfigError: If a parameter is wrong.
    """

    def __init__(self) -> None:
        self._parameters = private_parameters(RecordParameters)
        self._topics = _matcher(self._parameters.topics, self._parameters.also)
        self._folder = EpisodeFolder(Path(self._parameters.folder).expanduser().absolute())
        self._lock = threading.RLock()
        self._recorder: Recorder | None = None
        self._part = Path()
        self._episode = Episode(-1)
        self._begin_s = 0.0
        self._part_lock = -1
        self._status = rospy.Publisher("~status", String, queue_size=1, latch=True)
        for sentence in repair_all(self._folder):
            rospy.logwarn("%s", sentence)
        self._simulator = _Simulator(self._parameters.namespace)
        for name, action in (("start", self.start), ("stop", self.stop), ("discard", self.discard)):
            rospy.Service(f"~{name}", Trigger, lambda _, action=action: TriggerResponse(*_answer(action)))
        rospy.Service("~label", SetString, self._on_label)
        self._buttons: tuple[int, ...] = ()
        self._button_actions = self._actions_by_button()
        rospy.Subscriber("joy", Joy, self._on_joy, queue_size=10)
        self._keys = KeyDownSubscriber({_key_code(key): action for key, action in self._actions_by_key().items()})
        WallTimer(CHECK_HZ, self._check)
        self._publish_status()

    def start(self) -> str:
        """Starts an episode, and returns a message for the user; raises an InterfaceError if starting fails."""
        with self._lock:
            if self._recorder is not None:
                raise EpisodeError(self._folder.path, f"episode {self._episode.number} is being recorded")
            self._require_space()
            if not self._simulator.description:
                raise EpisodeError(self._folder.path, "no rpbi/world_description yet: is the simulator running?")
            if self._parameters.reset:
                self._simulator.reset()
            topics = _existing_topics(self._topics)
            self._begin(topics)
            return f"episode {self._episode.number} is being recorded: {len(topics)} topics"

    def stop(self) -> str:
        """Ends the current episode, and returns a message for the user.

        Raises:
            InterfaceError: If no episode is being recorded.
        """
        with self._lock:
            self._require_recording()
            self._simulator.wait_for_hash()
            return self._end("complete", "")

    def discard(self) -> str:
        """Discards the current episode, or the last one if none is being recorded; returns a message for the user."""
        with self._lock:
            if self._recorder is not None:
                self._end("incomplete", "discarded while it was recorded")
            elif self._episode.number < 0:
                raise EpisodeError(self._folder.path, "nothing to discard: this node has not recorded an episode")
            return f"episode {self._episode.number} is in {self._folder.discard(self._episode.number)}"

    def label(self, label: str) -> str:
        """Labels the current episode, or the last episode if none is being recorded; returns a message for the user."""
        with self._lock:
            if self._episode.number < 0:
                raise EpisodeError(self._folder.path, "nothing to label: this node has not recorded an episode")
            self._episode.label = checked_label(label)
            if self._recorder is not None:
                write_facts(self._part, self._episode)
            else:
                self._folder.relabel(self._episode.number, label)
            return f"episode {self._episode.number}: {label}"

    def end(self) -> None:
        """Ends the current episode, if there is one, with the state `incomplete`. Called when the node shuts down."""
        with self._lock:
            if self._recorder is not None:
                self._end("incomplete", "the node was ended while it was recorded")

    def _begin(self, topics: list[str]) -> None:
        parameters = self._parameters
        description = self._simulator.description
        is_own = files_of_world(description, (Path(each).expanduser() for each in parameters.copy_from))
        files, faults = store_files(description, self._folder.files, is_own)
        self._episode, self._part = self._folder.begin(
            started=datetime.now().astimezone().isoformat(timespec="seconds"),
            namespace=parameters.namespace,
            seeds=parameters.seeds,
            versions=versions(),
            git=git_state(),
            files=files,
            note="; ".join(faults),
        )
        part_lock = hold(self._part, MAX_LOCK_WAIT_S)
        space_mb = parameters.disk_reserve_mb / 2.0
        recorder = Recorder(self._part / BAG, topics, min_space_mb=space_mb, handles=(part_lock,))
        try:
            recorder.start()
            if fault := self._simulator.write_commands(self._part / EARLIER):
                rospy.logwarn("episode %d %s; restart the world, or set ~reset", self._episode.number, fault)
                self._episode.note = "; ".join(filter(None, (self._episode.note, fault)))
        except BaseException as error:
            self._episode.state, self._episode.note = "incomplete", str(error)
            try:
                self._folder.complete(self._part, self._episode)
            finally:
                os.close(part_lock)
            raise
        self._recorder, self._part_lock, self._begin_s = recorder, part_lock, time.monotonic()

    def _end(self, state: str, note: str) -> str:
        """Ends the current episode with a state and a note; returns a message for the user."""
        try:
            return self._ended(state, note)
        finally:
            os.close(self._part_lock)

    def _ended(self, state: str, note: str) -> str:
        assert self._recorder is not None
        recorder, self._recorder = self._recorder, None
        episode = self._episode
        episode.seconds = round(time.monotonic() - self._begin_s, 3)
        episode.published = recorder.published() or episode.published
        try:
            recorder.stop()
            episode.state = state
            episode.topics = measure_topics(self._part / BAG)
            late = sorted(set(_existing_topics(self._topics)) - set(recorder.topics))
            notes = [episode.note, note, f"began later, not recorded: {', '.join(late)}" if late else ""]
            if recorder.missing and episode.lost:
                episode.state = "incomplete"
                notes.append(f"{sum(episode.lost.values())} messages lost: the recorder did not read them at the end")
            episode.note = "; ".join(filter(None, notes))
        except BagError as error:
            return self._repair(error)
        try:
            self._folder.complete(self._part, episode)
        except OSError as error:
            return self._leave(error)
        text = f"episode {episode.number} is {episode.state}: {episode.messages} messages in {episode.seconds:.1f} s"
        if lost := sum(episode.lost.values()):
            text += f", {lost} lost"
        text += clock_note(episode.set_back_s)
        is_good = episode.state == "complete" and not lost and not episode.set_back_s
        (rospy.loginfo if is_good else rospy.logwarn)("%s %s", text, episode.note)
        self._publish_status()
        return text

    def _repair(self, fault: BagError) -> str:
        """Repairs the current episode from the files that the recorder wrote; returns a message for the user."""
        try:
            write_facts(self._part, self._episode)
            self._episode = repaired = repair(self._folder, self._part)
        except OSError as error:
            return self._leave(error)
        rospy.logerr("episode %d: %s: %s (%s)", repaired.number, repaired.state, repaired.note, fault)
        return f"episode {repaired.number} is {repaired.state}: {repaired.note}"

    def _leave(self, fault: OSError) -> str:
        """Logs that the episode stays in its temporary folder until a later repair; returns a message for the user."""
        text = f"episode {self._episode.number} stays in {self._part} until it is repaired: {fault}"
        rospy.logerr("%s", text)
        return text

    def _check(self) -> None:
        """Ends the current episode if the recorder has ended or the disk is nearly full. Also publishes the status."""
        with self._lock:
            if self._recorder is not None:
                self._episode.published = self._recorder.published() or self._episode.published
                self._episode.seconds = round(time.monotonic() - self._begin_s, 3)
                if not self._recorder.is_running:
                    self._end("incomplete", "the recorder has ended")
                elif (free := self._folder.free_mb()) < self._parameters.disk_reserve_mb:
                    self._end("incomplete", f"{free:.0f} MB free on the disk, less than the reserve")
                else:
                    self._write_facts()
            self._publish_status()

    def _write_facts(self) -> None:
        """Writes the description of the current episode; ends the episode if writing fails."""
        try:
            write_facts(self._part, self._episode)
        except OSError as error:
            self._end("incomplete", f"its description could not be written: {error}")

    def _publish_status(self) -> None:
        status = {
            "recording": self._recorder is not None,
            "episode": self._episode.number,
            "label": self._episode.label,
            "seconds": self._episode.seconds,
            "messages": self._episode.messages or sum(self._episode.published.values()),
            "free_mb": round(self._folder.free_mb()),
        }
        self._status.publish(json.dumps(status))

    def _require_recording(self) -> None:
        if self._recorder is None:
            raise EpisodeError(self._folder.path, "no episode is being recorded")

    def _require_space(self) -> None:
        free, reserve = self._folder.free_mb(), self._parameters.disk_reserve_mb
        if free < reserve:
            message = f"expected at least {reserve:.0f} MB free on the disk (~disk_reserve_mb), got {free:.0f} MB"
            raise EpisodeError(self._folder.path, message)

    def _toggle(self) -> str:
        return self.start() if self._recorder is None else self.stop()

    def _actions_by_key(self) -> dict[str, Callable[[], None]]:
        parameters = self._parameters
        return self._actions(parameters.start_key, parameters.discard_key, parameters.label_keys)

    def _actions_by_button(self) -> dict[int, Callable[[], None]]:
        parameters = self._parameters
        return self._actions(parameters.start_button, parameters.discard_button, parameters.label_buttons)

    def _actions(
        self, start: _Trigger | None, discard: _Trigger | None, labels: Mapping[_Trigger, str]
    ) -> dict[_Trigger, Callable[[], None]]:
        """Returns the function to call for each key or button. Functions whose key or button is None are left out."""
        actions = [(start, self._toggle), (discard, self.discard)]
        actions += [(each, partial(self.label, label)) for each, label in labels.items()]
        return {each: partial(_do, action) for each, action in actions if each is not None}

    def _on_label(self, request: SetStringRequest) -> SetStringResponse:
        return SetStringResponse(*_answer(lambda: self.label(request.data)))

    def _on_joy(self, message: Joy) -> None:
        pressed = [index for index, value in enumerate(message.buttons) if value and not _at(self._buttons, index)]
        self._buttons = tuple(message.buttons)
        for index in pressed:
            if index in self._button_actions:
                self._button_actions[index]()


def _at(buttons: tuple[int, ...], index: int) -> int:
    return buttons[index] if index < len(buttons) else 0


def _key_code(key: str) -> int:
    code = getattr(Key, f"KEY_{key}", None)
    if code is None:
        raise InterfaceError(f"unknown key '{key}': expected a name of keyboard/Key, such as a or SPACE")
    return int(code)


def _answer(action: Callable[[], str]) -> tuple[bool, str]:
    try:
        return True, action()
    except (InterfaceError, OSError) as error:
        return False, str(error)


def _do(action: Callable[[], str]) -> None:
    done, text = _answer(action)
    (rospy.loginfo if done else rospy.logwarn)("%s", text)


def _matcher(topics: tuple[str, ...] | str, also: tuple[str, ...]) -> Callable[[str], bool] | tuple[str, ...]:
    """Returns the full names of the topics to record if `topics` is a tuple of names.

    If `topics` is a regular expression, returns a function that returns whether to record a topic. The topics in `also`
    are recorded in both cases.
    """
    further = tuple(rospy.resolve_name(each) for each in also)
    if not isinstance(topics, str):
        return (*(rospy.resolve_name(each) for each in topics), *further)
    try:
        pattern = re.compile(topics)
    except re.error as error:
        raise InterfaceError(f"~topics: expected a regular expression, got '{topics}': {error}") from error
    return lambda topic: topic in further or pattern.fullmatch(topic) is not None


def _existing_topics(wanted: Callable[[str], bool] | tuple[str, ...]) -> list[str]:
    """Returns the topics to record: listed topics, or all existing topics that `wanted` accepts."""
    if isinstance(wanted, tuple):
        return sorted(wanted)
    publishers, subscribers, _ = rosgraph.Master(rospy.get_name()).getSystemState()
    return sorted({topic for topic, _ in (*publishers, *subscribers) if wanted(topic)})


def main() -> None:
    """Runs the node."""
    run_node("record", _start)


def _start() -> RecordNode:
    node = RecordNode()
    rospy.on_shutdown(node.end)
    return node
