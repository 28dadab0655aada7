"""A reset as ROS sees it: time goes on, topics stay, what came later goes, and nothing warns or leaks."""

from __future__ import annotations

import re
import sys
import threading
from pathlib import Path

import pytest
import rosbag
import rospy
from cob_srvs.srv import SetString
from node_world import Rosout, add, count, main_config, objects, publishing, registrations, remove, resident_mb
from ros_system import sends_to_us, wait_until
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Empty, Trigger
from tf2_msgs.msg import TFMessage
from worlds import BOX_FLOOR, ball, box, iiwa

from ros_pybullet_interface.msg import PybulletObject, SimulationState
from ros_pybullet_interface.srv import GetStateHash, ResetJointState, StepN
from rpbi_data import Recorder

JOINT = "lbr_iiwa_joint_1"
LISTEN = """
import rospy, tf2_ros
rospy.init_node("tf_listener", anonymous=True)
buffer = tf2_ros.Buffer()
listener = tf2_ros.TransformListener(buffer)
while not rospy.is_shutdown():
    if buffer.can_transform("rpbi/world", "rpbi/ball", rospy.Time(0)):
        print("transform", flush=True)
    rospy.rostime.wallsleep(0.2)
"""


@pytest.fixture
def start(ros, tmp_path):
    def open_world(use_sim_time=True, **main):
        arm = iiwa(
            joint_state_publisher_hz=500,
            broadcast_link_states=True,
            enabled_joint_force_torque_sensors=[{"joint": "lbr_iiwa_joint_7", "hz": 10}],
        )
        dynamic = (
            ball(basePosition=[1.0, 0.0, 0.5], broadcast_hz=100),
            box(basePosition=[1.0, 1.0, 0.5], broadcast_hz=50),
        )
        config = main_config(tmp_path, collision=(BOX_FLOOR,), dynamic=dynamic, robots=(arm,), **main)
        return ros.simulator(config, use_sim_time=use_sim_time)

    return open_world


def _reset(ros):
    answer = ros.call("/rpbi/reset", Trigger)
    assert answer.success, answer.message


def _increasing(stamps):
    return all(before < after for before, after in zip(stamps, stamps[1:]))


@pytest.mark.parametrize("running", [True, False], ids=["running", "stopped"])
@pytest.mark.parametrize("simulated", [True, False], ids=["sim time", "wall time"])
def test_time_continues_and_the_world_stays_running_or_stopped(ros, start, running, simulated):
    start(simulated, start_pybullet_after_initialization=running)
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    tf = ros.listen("/tf", TFMessage)
    state = ros.listen("/rpbi/state", SimulationState)
    clock = ros.listen("/clock", Clock)

    def ball_stamps():
        transforms = [each for message in list(tf.messages) for each in message.transforms]
        return [each.header.stamp.to_nsec() for each in transforms if each.child_frame_id == "rpbi/ball"]

    joint_states.wait_for(1)
    for resets in (1, 2, 3):
        before = ros.call("/rpbi/get_state_hash", GetStateHash).stamp.to_nsec()
        _reset(ros)
        told = wait_until(lambda resets=resets: [s for s in state.messages if s.resets == resets], "the state tells it")
        assert told[0].tick == 0 or running
        assert all(each.running == running for each in told if each.tick > 5)
        for topic, stamps in (("joint states", lambda: joint_states.stamps_ns), ("TF", ball_stamps)):
            wait_until(lambda stamps=stamps, before=before: stamps()[-1] > before, f"{topic} go on")
    state.wait_for(len(state.messages) + 3)  # time enough for a stamp to come again
    if simulated:
        clock.wait_for(1)
    for each in (joint_states.stamps_ns, ball_stamps()):
        assert _increasing(each), "a stamp repeated or went back"
    told = [message.clock.to_nsec() for message in clock.messages]
    assert told == sorted(told)
    assert bool(told) == simulated
    if not running:
        assert ros.call("/rpbi/get_state_hash", GetStateHash).tick == 0


@pytest.mark.quick
def test_the_same_state_follows_every_reset(ros, start):
    start(start_pybullet_after_initialization=False)
    hashes = []
    for _ in range(3):
        ros.call("/rpbi/step_n", StepN, 300)
        hashes.append(ros.call("/rpbi/get_state_hash", GetStateHash))
        ros.call("/rpbi/iiwa/set_control_mode", SetString, "VELOCITY_CONTROL")
        ros.call("/rpbi/step_n", StepN, 50)
        _reset(ros)
    assert {answer.state_hash for answer in hashes} == {hashes[0].state_hash}
    assert [answer.resets for answer in hashes] == [0, 1, 2]


def test_topics_follow_added_and_removed_objects_and_others_stay_connected(ros, start):
    start()
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    joint_states.wait_for(1)
    before, connections = registrations(), joint_states._subscriber.get_num_connections()
    assert add(ros, PybulletObject.ROBOT, iiwa("second")).success
    assert remove(ros, "box").success
    assert add(ros, config=ball("box", broadcast_hz=10, basePosition=[2.0, 0.0, 3.0])).success
    assert remove(ros, "ball").success
    during = registrations()
    assert during != before
    _reset(ros)
    assert objects(ros) == {"floor": "collision", "ball": "dynamic", "box": "dynamic", "iiwa": "robot"}
    wait_until(lambda: registrations() == before, "the ROS master knows what it knew before")
    assert joint_states._subscriber.get_num_connections() == connections
    seen = len(joint_states.messages)
    joint_states.wait_for(seen + 20)


def test_first_target_after_reset_is_obeyed_and_earlier_ones_dropped(ros, start):
    start(start_pybullet_after_initialization=False)
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    state = ros.listen("/rpbi/state", SimulationState)

    def is_taken(resets):
        return state.messages and state.messages[-1].resets == resets and state.messages[-1].commands == 1

    with publishing("/rpbi/iiwa/joint_states/target", JointState) as target:
        target.publish(JointState(name=[JOINT], position=[1.0]))
        wait_until(lambda: is_taken(resets=0), "the target has come")
        _reset(ros)
        ros.call("/rpbi/step_n", StepN, 500)
        last = ros.call("/rpbi/get_state_hash", GetStateHash).stamp.to_nsec()
        wait_until(lambda: joint_states.stamps_ns[-1:] == [last], "the last tick arrives")
        assert abs(joint_states.messages[-1].position[0]) < 0.01
        _reset(ros)
        target.publish(JointState(name=[JOINT], position=[0.3]))
        wait_until(lambda: is_taken(resets=2), "the target has come")
        ros.call("/rpbi/step_n", StepN, 1000)
        wait_until(lambda: abs(joint_states.messages[-1].position[0] - 0.3) < 0.01, "the target is obeyed")


def test_who_waits_is_answered_with_the_reason(ros, start):
    start()
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    answers = {}

    def move():
        answers["move"] = ros.call(
            "/rpbi/iiwa/move_to_joint_state", ResetJointState, JointState(name=[JOINT], position=[1.0]), 30.0
        )

    def zero():
        try:
            ros.call("/rpbi/iiwa/lbr_iiwa_joint_7/ft_sensor", Empty)
        except rospy.ServiceException as error:
            answers["zero"] = str(error)

    threads = [threading.Thread(target=job) for job in (move, zero)]
    for thread in threads:
        thread.start()
    wait_until(lambda: joint_states.messages and joint_states.messages[-1].position[0] > 0.01, "the move is under way")

    def all_answered():
        _reset(ros)  # again, since the zeroing may not have been under way yet
        return not any(thread.is_alive() for thread in threads)

    wait_until(all_answered, "both are answered")
    assert not answers["move"].success and "the world was reset" in answers["move"].message
    assert "the world was reset" in answers["zero"]


def test_poses_from_tf_are_taken_again(ros, tmp_path):
    follower = {**box("table"), "object_tf": {"tf_id": "table", "hz": 50}}
    del follower["baseMass"]
    falling = ball(basePosition=[2.0, 0.0, 1.5], broadcast_hz=50)
    config = main_config(tmp_path, collision=(follower,), dynamic=(falling,))
    frames = "2 0 1 0 0 0 rpbi/world table".split()
    ros.start(["rosrun", "tf2_ros", "static_transform_publisher", *frames])
    ros.simulator(config, use_sim_time=True)
    tf = ros.listen("/tf", TFMessage)

    def heights():
        messages = list(tf.messages)
        return [t.transform.translation.z for m in messages for t in m.transforms if t.child_frame_id == "rpbi/ball"]

    def rests_on_the_table():
        """Tells whether it lies there; where the table was late, the ball begins again."""
        last = heights()[-25:]
        if last and last[-1] < 1.0:
            _reset(ros)
        return len(last) == 25 and last == pytest.approx([1.2] * 25, abs=0.02)

    wait_until(rests_on_the_table, "the table's pose is known")
    _reset(ros)
    tf.messages.clear()
    wait_until(lambda: len(heights()) > 75, "it has had time to fall")  # a few of them may be from before the reset
    assert heights()[-1] == pytest.approx(1.2, abs=0.02), "the ball lies on the table, which is not at the origin"


def test_resets_at_once_from_many_are_all_served(ros, start):
    start()
    done = []
    threads = [threading.Thread(target=lambda: done.append(ros.call("/rpbi/reset", Trigger).success)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert done == [True] * 8


@pytest.mark.thorough
def test_a_hundred_resets_leave_no_trace(ros, start, tmp_path):
    """With a TF listener, a recorder and a controller attached."""
    process = start(True)
    rosout = Rosout(ros)
    wait_until(lambda: sends_to_us("/rosout", "/ros_pybullet_interface"), "the log is listened to")
    listener = ros.start([sys.executable, "-c", LISTEN])
    wait_until(lambda: "transform" in ros.output(listener), "TF is listened to")
    stop = threading.Event()
    bag = tmp_path / "resets.bag"
    with (
        Recorder(bag, ["/tf", "/rpbi/iiwa/joint_states", "/clock"]),
        publishing("/rpbi/iiwa/joint_states/target", JointState) as target,
    ):

        def control():
            while not stop.wait(0.005):
                target.publish(JointState(name=[JOINT], position=[0.5]))

        thread = threading.Thread(target=control)
        thread.start()
        for _ in range(10):
            _reset(ros)
        before = [count(process.pid, what) for what in ("task", "fd")], resident_mb(process.pid)
        for _ in range(90):
            _reset(ros)
        # The answer to the last request may still hold one, and memory what a subscriber has not taken yet.
        wait_until(
            lambda: all(count(process.pid, what) <= was for what, was in zip(("task", "fd"), before[0])),
            "there are no more threads and files than before",
        )
        wait_until(lambda: resident_mb(process.pid) < before[1] + 5.0, "there is no more memory in use than before")
        stop.set()
        thread.join()
    heard = len(ros.output(listener))
    wait_until(lambda: len(ros.output(listener)) > heard, "TF is still known")
    assert rosout.logs("refused") == []
    warned = [log.msg for log in rosout.logs() if log.level > 2 and log.name == "/ros_pybullet_interface"]
    harmless = ("the ROS master", "too slow", "too late")  # of the master, the machine, and targets on a busy one
    assert [message for message in warned if not any(words in message for words in harmless)] == []
    assert "TF_" not in ros.output(listener), "TF_OLD_DATA and the like"
    last: dict[str, int] = {}
    with rosbag.Bag(str(bag)) as recorded:
        for topic, message, _ in recorded.read_messages():
            entries = message.transforms if topic == "/tf" else [message]
            for entry in entries:
                stamp = (entry.clock if topic == "/clock" else entry.header.stamp).to_nsec()
                key = entry.child_frame_id if topic == "/tf" else topic
                assert stamp > last.get(key, 0) or (topic == "/clock" and stamp == last[key]), key
                last[key] = stamp


def test_the_page_names_the_service():
    page = (Path(__file__).resolve().parents[4] / "docs" / "time.md").read_text()
    assert re.search(r"`rpbi/reset` \(`std_srvs/Trigger`\)", page)
