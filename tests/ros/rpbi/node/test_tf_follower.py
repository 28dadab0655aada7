"""Bodies that follow TF over ROS: they carry what lies on them, and it is said when TF ceases."""

from __future__ import annotations

import pytest
import rospy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from node_world import Rosout, main_config, publishing
from ros_system import sends_to_us, wait_until
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from worlds import box

from ros_pybullet_interface.msg import WorldCommands
from ros_pybullet_interface.srv import StepN
from rpbi.config.pybullet_models import ObjectTf
from rpbi.engine.inputs import PoseInput
from rpbi.ros.tf_follower import FollowedFrame

SPEED = 0.3
TIME_STEP_S, TICKS = 0.002, 10
"""Length of a tick, and how many are between two poses of the hand."""
STALE = "hand/pose: TF of 'hand' is stale"
AGAIN = "hand/pose: TF of 'hand' comes again"


@pytest.fixture
def load_states(ros):
    """Starts a box on a hand that follows TF, and a shelf that follows static TF; its state, 50 times a second.

    The world stands still.
    """
    hand, shelf = box("hand", (0.6, 0.3, 0.05)), box("shelf")
    for body in (hand, shelf):
        del body["baseMass"]
    hand["object_tf"] = {"tf_id": "hand", "hz": 50}
    shelf["object_tf"] = {"tf_id": "shelf", "hz": 50}
    load = box("load", (0.05, 0.05, 0.05), basePosition=[0.0, 0.0, 0.1], base_state_hz=50)
    ros.start(["rosrun", "tf2_ros", "static_transform_publisher", *"5 0 0 0 0 0 rpbi/world shelf".split()])
    parts = {"timeStep": TIME_STEP_S, "start_pybullet_after_initialization": False}
    ros.simulator(main_config(ros.folder, collision=(hand, shelf), dynamic=(load,), **parts), use_sim_time=True)
    states = ros.listen("/rpbi/load/base_state", Odometry)
    states.wait_for(1)
    return states


def _hand_at(x, stamp):
    transform = TransformStamped(child_frame_id="hand")
    transform.header.frame_id, transform.header.stamp = "rpbi/world", stamp
    transform.transform.translation.x, transform.transform.rotation.w = x, 1.0
    return TFMessage([transform])


def _along(ros, states, publisher, seconds):
    """Moves the hand by the world's time, step by step, each pose taken before the next step; returns how far.

    It speeds up and slows down with 1 m/s^2, which friction can hold.
    """
    entered = ros.listen("/rpbi/commands", WorldCommands)

    def taken():
        """Returns how many poses of the hand have entered the world; whoever comes late is told some of them twice."""
        commands = {(m.first + i, c.name) for m in list(entered.messages) for i, c in enumerate(m.commands)}
        return sum(name == "hand/pose" for _, name in commands)

    stamp = states.messages[-1].header.stamp
    count = round(seconds / (TICKS * TIME_STEP_S))
    for index in range(1, count + 1):
        t = seconds * index / count
        rising, falling = min(t, SPEED), max(0.0, t - seconds + SPEED)
        x = 0.5 * rising**2 + SPEED * (t - rising) - 0.5 * falling**2
        publisher.publish(_hand_at(x, stamp))
        wait_until(lambda index=index: taken() == index, "the pose is taken", every_s=0.002)
        stamp = ros.call("/rpbi/step_n", StepN, TICKS).stamp
    states.wait_for_stamp(stamp)
    return x


def test_hand_moved_by_tf_carries_boxes_and_silence_warns_once(ros, load_states):
    rosout = Rosout(ros)
    wait_until(lambda: sends_to_us("/rosout", "/ros_pybullet_interface"), "the log is listened to")
    with publishing("/tf", TFMessage) as publisher:
        far = _along(ros, load_states, publisher, 1.0)
        assert max(state.twist.twist.linear.x for state in load_states.messages) > 0.9 * SPEED
        assert ros.call("/rpbi/start", Trigger).success
        rosout.wait_for([STALE])
        wait_until(lambda: abs(load_states.messages[-1].twist.twist.linear.x) < 1e-3, "the box is at rest")
        assert load_states.messages[-1].pose.pose.position.x == pytest.approx(far, abs=0.05)
        publisher.publish(_hand_at(far, rospy.Time.from_sec(load_states.messages[-1].header.stamp.to_sec() + 0.001)))
        rosout.wait_for([AGAIN])
    count = len(load_states.messages)
    load_states.wait_for(count + 50)
    assert len(rosout.logs(STALE)) == 1
    assert not rosout.logs("'shelf' is stale"), "static TF never changes"


@pytest.mark.parametrize(
    ("sent_ms", "seen_ms"),
    [
        (range(3, 500, 10), [30]),  # each third
        (range(3, 500, 33), [33]),  # each, though it comes a moment before or after a period
        (range(3, 500, 34), [34]),
        ((3 + 33 * n + (0, 4)[n % 2] for n in range(15)), [29, 37]),
        (range(3, 500, 100), [100]),
    ],
)
def test_stream_is_read_on_arrival_at_regular_intervals(sent_ms, seen_ms):
    followed = FollowedFrame("hand", "hand/pose", PoseInput.following(ObjectTf(tf_id="hand", hz=30), print))
    sent_ms = list(sent_ms)
    seen = []
    for now_ms in range(1, 490):
        came_ms = max((sent for sent in sent_ms if sent <= now_ms), default=-1)
        if now_ms / 1e3 >= followed.due_s(came_ms / 1e3):
            followed.looked_s = now_ms / 1e3
            if followed.is_new(came_ms, now_ms / 1e3, 0.0) and came_ms >= 0:
                assert now_ms - came_ms <= 1, "it is looked at later than it came"
                seen.append(now_ms)
    gaps = {later - earlier for earlier, later in zip(seen[1:], seen[2:])}
    assert sorted(gaps) == seen_ms


def test_frame_sent_by_others_is_read_every_period():
    followed = FollowedFrame("hand", "hand/pose", PoseInput.following(ObjectTf(tf_id="hand", hz=50), print))
    looks = []
    for now_ms in range(1000):
        if now_ms / 1e3 >= followed.due_s(-1.0):
            followed.looked_s = now_ms / 1e3
            looks.append(now_ms)
    assert len(looks) == 50
