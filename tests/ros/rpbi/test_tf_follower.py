"""Bodies that follow TF over ROS: they carry what lies on them, and it is said when TF ceases."""

from __future__ import annotations

import pytest
import rospy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from node_world import Rosout, main_config, publishing
from ros_system import wait_until
from tf2_msgs.msg import TFMessage
from worlds import box

SPEED = 0.3
STALE = "hand/pose: TF of 'hand' is stale"
AGAIN = "hand/pose: TF of 'hand' comes again"


@pytest.fixture
def load_states(ros):
    """Starts a box on a hand that follows TF, and a shelf that follows static TF; its state, 50 times a second."""
    hand, shelf = box("hand", (0.6, 0.3, 0.05)), box("shelf")
    for body in (hand, shelf):
        del body["baseMass"]
    hand["object_tf"] = {"tf_id": "hand", "hz": 50}
    shelf["object_tf"] = {"tf_id": "shelf", "hz": 50}
    load = box("load", (0.05, 0.05, 0.05), basePosition=[0.0, 0.0, 0.1], base_state_hz=50)
    ros.start(["rosrun", "tf2_ros", "static_transform_publisher", *"5 0 0 0 0 0 rpbi/world shelf".split()])
    ros.simulator(main_config(ros.folder, collision=(hand, shelf), dynamic=(load,), timeStep=0.002), use_sim_time=True)
    states = ros.listen("/rpbi/load/base_state", Odometry)
    states.wait_for(1)
    return states


def _hand_at(x, stamp):
    transform = TransformStamped(child_frame_id="hand")
    transform.header.frame_id, transform.header.stamp = "rpbi/world", stamp
    transform.transform.translation.x, transform.transform.rotation.w = x, 1.0
    return TFMessage([transform])


def _along(states, publisher, seconds):
    """Moves the hand by the world's time, at each state of what lies on it; returns how far, and the states."""
    first = len(states.messages)
    begin = states.messages[-1].header.stamp
    count, x = first, 0.0
    while x < SPEED * seconds:
        count += 1
        stamp = states.wait_for(count)[count - 1].header.stamp
        elapsed = (stamp - begin).to_sec()
        x = SPEED * max(elapsed - 0.15, 0.5 * elapsed**2 / 0.3 if elapsed < 0.3 else 0.0)
        publisher.publish(_hand_at(x, stamp))
    return x, states.messages[first:]


def test_a_hand_that_tf_moves_carries_a_box_and_when_tf_ceases_that_is_said_once(ros, load_states):
    rosout = Rosout(ros)
    with publishing("/tf", TFMessage) as publisher:
        far, states = _along(load_states, publisher, 1.5)
        speeds = [state.twist.twist.linear.x for state in states][len(states) // 2 :]
        assert sum(speeds) / len(speeds) == pytest.approx(SPEED, rel=0.05)
        rosout.wait_for([STALE])
        assert abs(load_states.messages[-1].twist.twist.linear.x) < 1e-3
        assert load_states.messages[-1].pose.pose.position.x == pytest.approx(far, abs=0.01)
        publisher.publish(_hand_at(far, rospy.Time.from_sec(load_states.messages[-1].header.stamp.to_sec() + 0.001)))
        rosout.wait_for([AGAIN])
    count = len(load_states.messages)
    load_states.wait_for(count + 50)
    assert len(rosout.logs(STALE)) == 1
    assert not rosout.logs("'shelf'"), "static TF never changes"
