"""Time, in all its combinations: nothing hangs, no stamp repeats or goes back, no message is missing in a bag."""

from __future__ import annotations

from pathlib import Path

import pytest
import rosbag
import yaml
from ros_system import wait_until
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from worlds import ball, iiwa, write_world

from rpbi_data import Recorder

STATES = {
    "running": {},  # in real time
    "stopped": {"start_pybullet_after_initialization": False},
    "stepped": {"start_pybullet_after_initialization": False},
    "as fast as it goes": {"real_time_factor": 0},
    "slow": {"real_time_factor": 0.1},
}
STEPS = 60
"""At least so many; as many as the client needs."""
MESSAGES = 20
"""Of joint states that the others are waited for."""
HZ = {"as fast as it goes": 5}
"""Rate of joint states and TF [Hz], 50 where nothing is said. `rosbag record` keeps 100 messages a topic, which at
hundreds of simulated seconds a second is little on a busy machine; what it drops is not for this test to say."""


CLOCKS = {"sim time": True, "wall time": False}
THOROUGH = {("stopped", "wall time"), ("stepped", "wall time"), ("as fast as it goes", "wall time")}
THOROUGH |= {("slow", clock) for clock in CLOCKS}


def _cases():
    """Returns each state with each clock; some of them run only with `./rpbi test --all`."""
    return [
        pytest.param(
            (state, CLOCKS[clock]),
            id=f"{state}, {clock}",
            marks=[pytest.mark.thorough] if (state, clock) in THOROUGH else [],
        )
        for state in STATES
        for clock in CLOCKS
    ]


@pytest.fixture(params=_cases())
def case(request):
    return request.param


@pytest.fixture
def state(case):
    return case[0]


@pytest.fixture
def simulated(case):
    return case[1]


@pytest.fixture
def scene(ros, tmp_path, state, simulated):
    """The simulator, listeners from the start, and then those that come late: a tf2 listener and a recorder."""
    hz = HZ.get(state, 50)
    objects = {"dynamic": (ball(broadcast_hz=hz),), "robots": (iiwa(joint_state_publisher_hz=hz),)}
    path = write_world(tmp_path, **objects, **STATES[state])
    world = yaml.safe_load(Path(path).read_text())
    for section in ("dynamic_objects", "robots"):
        world[section] = [str(tmp_path / name) for name in world[section]]
    clock = ros.listen("/clock", Clock)
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    tf = ros.listen("/tf", TFMessage)
    ros.simulator(world, use_sim_time=simulated)
    joint_states.wait_for(1)
    client = ros.start_program("late_client.py", "rpbi/ball")
    bag = tmp_path / "late.bag"
    recorder = Recorder(bag, ["/rpbi/iiwa/joint_states", "/tf"])
    recorder.start()
    yield dict(clock=clock, joint_states=joint_states, tf=tf, client=client, bag=bag, recorder=recorder)
    if recorder.is_running:
        recorder.stop()


def _drive(ros, scene, state, simulated):
    """Lets the world live for a while, in the way of its state; returns the stamps of its steps [ns]."""
    joint_states = scene["joint_states"]
    if state == "stepped":
        stamps: list[int] = []

        def step():
            stamps.append(int(ros.call("/rpbi/step", Trigger).message.split("stamp ")[1].replace(".", "")))
            return len(stamps) >= STEPS and "slept" in ros.output(scene["client"])

        wait_until(step, "the client's sleep in ROS time ends", every_s=0.0)
        for told in (lambda: joint_states.stamps_ns, lambda: _ball_stamps(scene["tf"].messages)):
            wait_until(lambda told=told: told()[-1] >= stamps[-1], "the last step is told")
        return stamps
    if state != "stopped" or not simulated:
        joint_states.wait_for(len(joint_states.messages) + MESSAGES)
    return []


def test_time_behaves(ros, scene, state, simulated):
    steps_ns = _drive(ros, scene, state, simulated)
    client = scene["client"]
    stands_still = state == "stopped" and simulated
    wait_until(lambda: "transform" in ros.output(client), f"tf2 knows the ball: {ros.output(client)}")
    if stands_still:
        assert "slept" not in ros.output(client)
        ros.call("/rpbi/start", Trigger)
        wait_until(lambda: "slept" in ros.output(client), "ROS time goes on after a start")
        ros.call("/rpbi/stop", Trigger)
    else:
        wait_until(lambda: "slept" in ros.output(client), "the client's sleep in ROS time ends")
    assert client.wait(60.0) == 0, ros.output(client)

    scene["recorder"].stop()
    recorded = _recorded(scene["bag"])

    for stamps in (scene["joint_states"].stamps_ns, _ball_stamps(scene["tf"].messages), *recorded.values()):
        assert stamps, "nothing came"
        assert stamps[0] > 0
        assert all(before < after for before, after in zip(stamps, stamps[1:])), "a stamp repeated or went back"

    clock_ns = [message.clock.to_nsec() for message in scene["clock"].messages]
    if simulated:
        assert clock_ns and clock_ns[0] > 0
        assert all(before <= after for before, after in zip(clock_ns, clock_ns[1:])), "the clock went back"
    else:
        assert clock_ns == []

    if simulated and state in ("running", "slow", "as fast as it goes"):
        for topic, stamps in recorded.items():
            gaps = {after - before for before, after in zip(stamps, stamps[1:])}
            assert gaps <= {10**9 // HZ.get(state, 50)}, f"{topic}: messages are missing in the bag: {gaps}"
    if state == "stepped" and simulated:
        for stamps in (scene["joint_states"].stamps_ns, _ball_stamps(scene["tf"].messages)):
            assert stamps[-len(steps_ns) :] == steps_ns, "every step is told once"


def _ball_stamps(messages):
    return [
        transform.header.stamp.to_nsec()
        for message in messages
        for transform in message.transforms
        if transform.child_frame_id == "rpbi/ball"
    ]


def _recorded(path):
    joint_states, tf = [], []
    with rosbag.Bag(str(path)) as bag:
        for topic, message, _ in bag.read_messages(topics=["/rpbi/iiwa/joint_states", "/tf"]):
            if topic == "/tf":
                tf += _ball_stamps([message])
            else:
                joint_states.append(message.header.stamp.to_nsec())
    return {"joint states": joint_states, "tf": tf}
