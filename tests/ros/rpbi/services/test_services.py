"""Start, stop and step: what they answer in every state, and what they do."""

from __future__ import annotations

import re

import pytest
from node_world import main_config
from ros_system import wait_until
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Int64
from std_srvs.srv import Trigger
from worlds import ball, iiwa

JOINT_STATES_PERIOD_NS = 20_000_000


@pytest.fixture(scope="module")
def node(module_ros):
    config = main_config(module_ros.folder, dynamic=(ball(broadcast_hz=50),), robots=(iiwa(),))
    return module_ros.simulator(config, use_sim_time=True)


@pytest.fixture
def simulator(ros, node):
    ros.call("/rpbi/start", Trigger)
    return node


def _tick_and_stamp(answer):
    assert answer.success, answer.message
    match = re.fullmatch(r"tick (\d+), stamp (\d+)\.(\d{9})", answer.message)
    assert match, answer.message
    return int(match[1]), int(match[2]) * 1_000_000_000 + int(match[3])


def test_start_and_stop_say_whether_they_changed_anything(ros, simulator):
    status = ros.listen("/rpbi/status", Int64)
    again = ros.call("/rpbi/start", Trigger)
    assert (again.success, again.message) == (False, "already running")
    stopped = ros.call("/rpbi/stop", Trigger)
    assert (stopped.success, stopped.message) == (True, "stopped")
    wait_until(lambda: status.messages and status.messages[-1].data == 0, "the status says stopped")
    again = ros.call("/rpbi/stop", Trigger)
    assert (again.success, again.message) == (False, "already stopped")
    started = ros.call("/rpbi/start", Trigger)
    assert (started.success, started.message) == (True, "started")
    wait_until(lambda: status.messages[-1].data == 1, "the status says running")


def test_nothing_moves_while_stopped_and_time_continues_afterwards(ros, simulator):
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    clock = ros.listen("/clock", Clock)
    ros.call("/rpbi/stop", Trigger)
    standing = wait_until(lambda: _standing(clock), "the clock stands")
    clock.wait_for(len(clock.messages) + 6)
    assert _standing(clock) == standing
    wait_until(lambda: joint_states.stamps_ns[-1:] == [standing], "the last tick is told")
    ros.call("/rpbi/start", Trigger)
    first = wait_until(lambda: [stamp for stamp in joint_states.stamps_ns if stamp > standing], "time goes on")[0]
    assert first <= standing + JOINT_STATES_PERIOD_NS, "time jumped over the pause"


def test_a_step_is_refused_while_running(ros, simulator):
    answer = ros.call("/rpbi/step", Trigger)
    assert not answer.success
    assert "running" in answer.message and "stop" in answer.message


@pytest.mark.quick
def test_step_advances_one_tick_and_all_its_messages_arrive(ros, simulator):
    ros.call("/rpbi/stop", Trigger)
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    clock = ros.listen("/clock", Clock)
    status = ros.listen("/rpbi/status", Int64)
    for listener in (joint_states, clock, status):
        listener.wait_for(1)
    wait_until(lambda: status.messages[-1].data == 0, "the status says stopped")
    before = len(status.messages)
    first_tick, first_stamp = _tick_and_stamp(ros.call("/rpbi/step", Trigger))
    second_tick, second_stamp = _tick_and_stamp(ros.call("/rpbi/step", Trigger))
    assert second_tick == first_tick + 1
    assert second_stamp == first_stamp + 1_000_000
    assert first_stamp == (first_tick + 1) * 1_000_000
    for stamp in (first_stamp, second_stamp):
        wait_until(lambda stamp=stamp: stamp in joint_states.stamps_ns, "its joint states arrive")
        wait_until(
            lambda stamp=stamp: stamp in [message.clock.to_nsec() for message in clock.messages], "its clock comes"
        )
    wait_until(
        lambda: "10" in "".join(str(message.data) for message in status.messages[before:]),
        "the status was 1 during a step and 0 after it",
    )
    wait_until(lambda: status.messages[-1].data == 0, "the status says stopped")


def test_answer_to_a_stop_comes_after_the_last_tick(ros, simulator):
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    clock = ros.listen("/clock", Clock)
    joint_states.wait_for(5)
    assert ros.call("/rpbi/stop", Trigger).success
    last = wait_until(lambda: _standing(clock), "the clock stands")
    wait_until(lambda: joint_states.stamps_ns[-1] == last, "the joint states of the last tick arrive")


def _standing(clock):
    stamps = [message.clock.to_nsec() for message in clock.messages[-3:]]
    return stamps[-1] if len(stamps) == 3 and len(set(stamps)) == 1 else None
