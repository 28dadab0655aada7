"""TF through one object."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from ros_system import wait_until
from rosgraph_msgs.msg import Clock

from custom_ros_tools.tf import TfInterface

HALF = math.sqrt(0.5)
MESSAGE = TransformStamped(transform=Transform(Vector3(1, 2, 2), Quaternion(0, 0, HALF, HALF)))
MATRIX = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 2], [0, 0, 0, 1.0]])


@pytest.fixture
def tf(own_tf) -> TfInterface:
    """The tests' TF."""
    wait_until(lambda: own_tf.tf_broadcaster.pub_tf.get_num_connections(), "it hears itself")
    return own_tf


@pytest.mark.quick
def test_published_transform_can_be_looked_up(tf):
    tf.set_tf("world", "box", [1, 2, 3], [0, 0, 1, 1])
    position, quat = tf.wait_for_tf("world", "box", timeout=60)
    np.testing.assert_allclose(position, [1, 2, 3])
    np.testing.assert_allclose(quat, [0, 0, HALF, HALF])
    position, quat = tf.get_tf("box", "world")  # the other way round
    np.testing.assert_allclose(position, [-2, 1, -3], atol=1e-12)


@pytest.mark.parametrize(
    ("orientation", "in_deg"), [((0, 0, 90), True), ((0, 0, math.pi / 2), False), ((0, 0, HALF, HALF), True)]
)
def test_three_numbers_are_roll_pitch_yaw(tf, orientation, in_deg):
    """Defect 48."""
    tf.set_tf("world", "turned", [0, 0, 0], orientation, eul_deg=in_deg)
    np.testing.assert_allclose(tf.wait_for_tf("world", "turned", 60)[1], [0, 0, HALF, HALF], atol=1e-12)


def test_matrix_can_be_published(tf):
    tf.set_matrix("world", "matrix", MATRIX)
    np.testing.assert_allclose(tf.msg_to_matrix(tf.wait_for_tf_msg("world", "matrix", 60)), MATRIX, atol=1e-12)


def test_frame_that_is_not_there_is_none(tf):
    assert tf.get_tf_msg("world", "nowhere") is None
    assert tf.get_tf("world", "nowhere") == (None, None)
    assert tf.wait_for_tf_msg("world", "nowhere", timeout=0.0) is None
    assert tf.wait_for_tf("world", "nowhere", timeout=0.05) == (None, None)


@pytest.mark.parametrize(
    "faulty", [([math.nan, 0, 0], (0, 0, 0, 1)), ([0, 0, 0], (0, 0, 0, 0)), ([0, 0], (0, 0, 0)), ([0, 0, 0], (0, 0))]
)
def test_invalid_transform_is_refused(tf, faulty):
    with pytest.raises(ValueError):
        tf.set_tf("world", "faulty", *faulty)


def test_transform_without_frames_can_be_packed_for_a_service():
    packed = TfInterface.pack_tf([1, 2, 3], [0, 0, 2, 2])
    assert packed.translation == Vector3(1, 2, 3)
    np.testing.assert_allclose(TfInterface.tf_msg_to_quat(packed), [0, 0, HALF, HALF])


def test_conversions_of_transforms_with_and_without_frames_agree():
    t = TfInterface
    for with_frames, without in (
        (t.msg_to_pos, t.tf_msg_to_pos),
        (t.msg_to_quat, t.tf_msg_to_quat),
        (t.msg_to_eul, t.tf_msg_to_eul),
        (t.msg_to_pos_magnitude, t.tf_msg_to_pos_magnitude),
    ):
        np.testing.assert_array_equal(with_frames(MESSAGE), without(MESSAGE.transform))


def test_conversions_give_position_turn_distance_and_matrix():
    t = TfInterface
    np.testing.assert_allclose(t.msg_to_pos(MESSAGE), [1, 2, 2])
    np.testing.assert_allclose(t.msg_to_quat(MESSAGE), [0, 0, HALF, HALF])
    np.testing.assert_allclose(t.msg_to_eul(MESSAGE), [0, 0, math.pi / 2], atol=1e-12)
    assert t.msg_to_pos_magnitude(MESSAGE) == pytest.approx(3.0)
    np.testing.assert_allclose(np.concatenate(t.msg_to_pos_quat(MESSAGE)), [1, 2, 2, 0, 0, HALF, HALF])
    np.testing.assert_allclose(np.concatenate(t.msg_to_pos_eul(MESSAGE)), [1, 2, 2, 0, 0, math.pi / 2], atol=1e-12)
    np.testing.assert_allclose(t.msg_to_matrix(MESSAGE), MATRIX, atol=1e-12)
    np.testing.assert_allclose(t.pos_quat_to_matrix([1, 2, 2], [0, 0, 1, 1]), MATRIX, atol=1e-12)
    np.testing.assert_allclose(t.pos_quat_to_matrix([0, 0, 0]), np.eye(4))


SCRIPT = """
import threading
import rospy
from custom_ros_tools.tf import TfInterface
rospy.init_node("waits")
tf = TfInterface()
timer = threading.Timer({shutdown_s}, rospy.signal_shutdown, ["the test wants it"])
timer.daemon = True
timer.start()
print(tf.wait_for_tf("world", "box", timeout=float("{timeout}")), flush=True)
"""


def test_waiting_times_out_while_simulated_time_is_paused(ros):
    rospy.set_param("/use_sim_time", True)
    clock = rospy.Publisher("/clock", Clock, latch=True, queue_size=1)
    clock.publish(rospy.Time(5))
    process = ros.start([sys.executable, "-c", SCRIPT.format(timeout=0.1, shutdown_s=50.0)])
    assert process.wait(60.0) == 0, ros.output(process)
    assert "(None, None)" in ros.output(process)
    clock.unregister()


def test_waiting_ends_when_ros_shuts_down(ros):
    process = ros.start([sys.executable, "-c", SCRIPT.format(timeout="inf", shutdown_s=0.5)])
    assert process.wait(60.0) == 1
    assert "ROSInterruptException: shut down while waiting for TF from 'world' to 'box'" in ros.output(process)
