"""A subscriber that stops taking its messages stops nobody else, and gets what was kept when it takes them again."""

from __future__ import annotations

import os
import signal
import threading

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from node_world import diagnosed, main_config
from ros_system import sends_to_us, wait_until
from sensor_msgs.msg import JointState
from soft_meshes import DEFORMABLE, block, write_block
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker
from worlds import ball, iiwa

FROZEN_MESSAGES = 2500
"""More than sockets and queues hold."""
PERIOD_NS = 2_000_000
AT_ITS_RATE = 0.9
STEPS = 100


@pytest.fixture
def frozen(ros, tmp_path):
    """A simulator whose topics somebody subscribes to who is then stopped; what it says of itself meanwhile."""
    config = main_config(
        tmp_path,
        dynamic=(ball(broadcast_hz=250, basePosition=[1.5, 0.0, 0.5]),),
        robots=(iiwa(joint_state_publisher_hz=500, broadcast_link_states=True, broadcast_link_states_hz=250),),
        timeStep=0.002,
    )
    ros.simulator(config, use_sim_time=True)
    topics = ["/clock", "/tf", "/rpbi/iiwa/joint_states"]
    holder = ros.start_program("hold_topics.py", *topics)
    wait_until(lambda: "listening" in ros.output(holder), "it listens")
    os.kill(holder.pid, signal.SIGSTOP)
    yield holder
    os.kill(holder.pid, signal.SIGCONT)


@pytest.mark.thorough
def test_ticks_continue_while_a_subscriber_is_frozen(ros, frozen):
    diagnostics = ros.listen("/diagnostics", DiagnosticArray)
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    joint_states.wait_for(FROZEN_MESSAGES)

    def factors():
        return [float(diagnosed(message)["real_time_factor"]) for message in diagnostics.messages[1:]]

    diagnostics.messages.clear()
    # The best of them: another program on the same machine may take some of its time, a frozen one must not take all.
    wait_until(lambda: len(factors()) >= 2 and max(factors()) >= AT_ITS_RATE, "it goes at its rate")
    stamps = joint_states.stamps_ns
    gaps = {after - before for before, after in zip(stamps, stamps[1:], strict=False)}
    assert gaps == {PERIOD_NS}, "others miss some"
    assert min(factors()) > 0.0


def test_slow_subscriber_receives_the_rest_without_further_messages(ros, tmp_path):
    """A world in wall time that stands still publishes at its rates, which here is never."""
    fine = write_block(tmp_path, "fine.vtk", across=12)
    soft = block(tmp_path, surface_hz=0.001, load={"fileName": fine})
    parts = {"timeStep": 0.004, "start_pybullet_after_initialization": False, **DEFORMABLE}
    ros.simulator(main_config(tmp_path, soft=(soft,), **parts))
    reads, stamps, sizes = threading.Event(), [], []

    def on_message(message):
        reads.wait(120.0)
        stamps.append(message.header.stamp)
        sizes.append(len(message.points))

    subscriber = rospy.Subscriber("/rpbi/jelly/surface", Marker, on_message)
    try:
        wait_until(lambda: sends_to_us("/rpbi/jelly/surface"), "it is connected")
        answers = [ros.call("/rpbi/step", Trigger).message for _ in range(STEPS)]
        reads.set()
        wait_until(lambda: len(stamps) == STEPS, "it has all")
    finally:
        reads.set()
        subscriber.unregister()
    assert [f"{stamp.secs}.{stamp.nsecs:09d}" for stamp in stamps] == [answer.split()[-1] for answer in answers]
    assert sum(sizes) * 24 > 8e6, "sockets may hold all of that: this test shows nothing"
