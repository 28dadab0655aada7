"""What comes in while the world runs is hostile: refused whole, named now and then, and without any effect."""

from __future__ import annotations

import math
import re
import time

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped
from node_world import Rosout, add, diagnosed, main_config, objects, publishing, remove
from ros_system import wait_until
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState
from std_msgs.msg import Int64
from tf2_msgs.msg import TFMessage
from worlds import FLOOR, ball, iiwa

from custom_ros_tools.ros.tf_interface import END_OF_TIME_S, fault_in
from ros_pybullet_interface.msg import PybulletObject

TOPIC = "/rpbi/iiwa/joint_states/target"
JOINT = "lbr_iiwa_joint_4"
GOAL = 0.6
FAR_M = 1e308
WARNING_PERIOD_S = 5.0


@pytest.fixture(scope="module")
def node(module_ros):
    config = main_config(
        module_ros.folder,
        collision=(
            {**FLOOR, "name": "lost", "object_tf": {"tf_id": "never/there", "hz": 100}},
            {**FLOOR, "name": "follower", "object_tf": {"tf_id": "marker", "hz": 100}},
        ),
        dynamic=(ball(broadcast_hz=50, basePosition=[1.5, 0.0, 5.0]),),
        robots=(iiwa(broadcast_link_states=True),),
        setGravity={},
        timeStep=0.002,
    )
    return module_ros.simulator(config)


@pytest.fixture(scope="module")
def target(node):
    """Publishes targets; one for all tests, since rospy may miss a publisher that comes back at once."""
    with publishing(TOPIC, JointState) as publisher:
        yield publisher


@pytest.fixture(scope="module")
def tf_publisher(node):
    with publishing("/tf", TFMessage) as publisher:
        yield publisher


def _most_warnings(since_s):
    """Returns how often one subject may have been named since some time [s], however long a busy machine took."""
    return 1 + (time.monotonic() - since_s) // WARNING_PERIOD_S


def _kinds(logs):
    """Returns the number of kinds of refusals, each of which is logged at once for the first time."""
    return len({re.sub(r"-?\d[\d.]*(e[-+]?\d+)?", "#", log.msg.partition(" (")[0]) for log in logs})


def _is_finite(message):
    values = [*message.position, *message.velocity, *message.effort]
    return all(map(math.isfinite, values))


def test_bad_targets_are_refused_whole_and_named_occasionally(ros, node):
    rosout = Rosout(ros)
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    tf = ros.listen("/tf", TFMessage)
    began_s = time.monotonic()
    ros.start_program("flood_targets.py", TOPIC, JOINT, str(GOAL))
    wait_until(
        lambda: joint_states.messages and abs(joint_states.messages[-1].position[3] - GOAL) < 0.01,
        "good ones are obeyed",
    )
    settled = len(joint_states.messages)
    rosout.wait_for([TOPIC])
    wait_until(lambda: rosout.logs("more like it"), "it is named once more after 5 s, with how many were kept back")
    warnings = [log for log in rosout.logs(TOPIC) if log.level == Log.WARN]
    seldom = 1 + _most_warnings(began_s) // 12  # of what is of no use in this mode, once a minute
    assert 1 < len(warnings) <= _most_warnings(began_s) + seldom + _kinds(warnings), [log.msg for log in warnings]
    assert "message refused: " in warnings[0].msg
    assert all(map(_is_finite, joint_states.messages))
    for message in joint_states.messages[settled:]:
        assert message.position[3] == pytest.approx(GOAL, abs=0.02), "a bad target moved the arm"
        assert message.position[0] == pytest.approx(0.0, abs=0.02), "half of a bad target was obeyed"
    translations = [transform.transform.translation for message in tf.messages for transform in message.transforms]
    assert all(math.isfinite(value) for each in translations for value in (each.x, each.y, each.z))
    assert node.poll() is None


REFUSALS = {
    "NaN": (JointState(name=[JOINT], position=[math.nan]), "values must be finite, got nan for joint"),
    "infinity": (JointState(name=[JOINT], position=[-math.inf]), "values must be finite, got -inf"),
    "unknown joint": (JointState(name=["elbow"], position=[0.0]), "unknown joint 'elbow': known are lbr_iiwa_joint_1"),
    "too few": (JointState(name=[JOINT, "lbr_iiwa_joint_1"], position=[0.0]), "expected one value for each of the 2"),
    "velocity only": (JointState(name=[JOINT], velocity=[1.0]), "expected position, since the robot is under"),
    "effort only": (JointState(name=[JOINT], effort=[1.0]), "expected position, since the robot is under"),
    "NaN velocity": (
        JointState(name=[JOINT], position=[0.2], velocity=[math.nan]),
        "values must be finite, got nan for joint",
    ),
    "infinite effort": (JointState(name=[JOINT], position=[0.2], effort=[math.inf]), "values must be finite, got inf"),
    "velocities of others": (
        JointState(name=[JOINT], position=[0.2], velocity=[0.0, 1.0]),
        "expected one value for each of the 1 joints named, got 2",
    ),
    "named twice": (JointState(name=[JOINT, JOINT], position=[0.0, 1.0]), "joints must be named once each"),
}


@pytest.mark.quick
@pytest.mark.parametrize("case", REFUSALS)
def test_a_refusal_names_topic_and_reason(ros, node, case):
    message, reason = REFUSALS[case]
    # A robot of its own, so that nothing was said about its topic in the last seconds.
    name = "refuses_" + case.replace(" ", "_")
    load = {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True, "basePosition": [0.0, 3.0, 0.0]}
    assert add(ros, PybulletObject.ROBOT, iiwa(name, loadURDF=load)).success
    rosout = Rosout(ros)
    with publishing(f"/rpbi/{name}/joint_states/target", JointState) as target:
        target.publish(message)
        rosout.wait_for([f"/{name}/joint_states/target: message refused: {reason}"])
    assert remove(ros, name).success


def test_message_without_names_or_with_extra_values_does_no_harm(ros, target):
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    target.publish(JointState())
    target.publish(JointState(name=[JOINT], position=[0.2], velocity=[0.0], effort=[1.0]))
    wait_until(
        lambda: joint_states.messages and abs(joint_states.messages[-1].position[3] - 0.2) < 0.01, "it is obeyed"
    )


def test_targets_however_large_leave_the_world_finite(ros, target):
    joint_states = ros.listen("/rpbi/iiwa/joint_states", JointState)
    status = ros.listen("/rpbi/status", Int64)
    status.wait_for(1)
    for value in (1e30, -1e300, 1.7e308):
        target.publish(JointState(name=[JOINT], position=[value]))
        joint_states.wait_for(len(joint_states.messages) + 10)
    target.publish(JointState(name=[JOINT], position=[0.0]))
    wait_until(lambda: abs(joint_states.messages[-1].position[3]) < 0.01, "it comes back")
    assert all(map(_is_finite, joint_states.messages))
    assert {message.data for message in status.messages} == {1}


def test_tf_that_never_comes_is_named(ros, node):
    rosout = Rosout(ros)
    began_s = time.monotonic()
    missing = {**FLOOR, "name": "also_lost", "object_tf": {"tf_id": "never/there/either", "hz": 10}}
    assert add(ros, PybulletObject.COLLISION, missing).success
    rosout.wait_for(["no TF from 'rpbi/world' to 'never/there/either'"])
    said = rosout.logs("never/there/either")
    assert len(said) < _most_warnings(began_s) and said[0].level == Log.WARN
    assert "also_lost" in said[0].msg
    assert remove(ros, "also_lost").success


def _transform(child, x=0.0, quat=(0.0, 0.0, 0.0, 1.0), stamp=None):
    transform = TransformStamped(child_frame_id=child)
    transform.header.frame_id = "rpbi/world"
    transform.header.stamp = stamp or rospy.Time.from_sec(time.time())
    transform.transform.translation.x = x
    rotation = transform.transform.rotation
    rotation.x, rotation.y, rotation.z, rotation.w = quat
    return TFMessage([transform])


NO_POSES = {
    "NaN position": _transform("marker", math.nan),
    "infinite position": _transform("marker", math.inf),
    "NaN rotation": _transform("marker", 0.0, (math.nan, 0.0, 0.0, 1.0)),
    "no rotation": _transform("marker", 0.0, (0.0, 0.0, 0.0, 0.0)),
    "long rotation": _transform("marker", 0.0, (0.0, 0.0, 0.0, 2.0)),
    "in itself": _transform("rpbi/world"),
    "nameless": _transform(""),
    "after the end of time": _transform("marker", stamp=rospy.Time(END_OF_TIME_S, 0)),
    "later still": _transform("marker", stamp=rospy.Time(2**32 - 1, 0)),
    "just after it": _transform("marker", stamp=rospy.Time(END_OF_TIME_S - 1, 1_000_000_000)),
}


@pytest.mark.parametrize("case", NO_POSES)
def test_faults_that_tf2_would_report_are_found_before(case):
    [transform] = NO_POSES[case].transforms
    assert fault_in(transform).startswith("expected ")
    assert fault_in(_transform("marker").transforms[0]) is None


def test_invalid_tf_changes_nothing_and_does_not_flood_the_log(ros, node, tf_publisher):
    rosout = Rosout(ros)
    rosout.wait_to_hear("/ros_pybullet_interface")
    tf = ros.listen("/tf", TFMessage)
    printed = ros.output(node).count("\n")
    began_s = time.monotonic()
    for _ in range(100):
        for message in NO_POSES.values():
            tf_publisher.publish(message)
        tf_publisher.publish(_transform("marker", FAR_M))
        time.sleep(0.01)
    tf_publisher.publish(_transform("marker", 1.0))
    rosout.wait_for(["TF from /tests"])
    own = [t.transform for message in tf.messages for t in message.transforms if t.child_frame_id.startswith("rpbi/")]
    assert own and all(math.isfinite(t.translation.x + t.rotation.w) for t in own)
    refused = rosout.logs("TF from /tests")
    assert len(refused) <= _most_warnings(began_s) + _kinds(refused)
    lines = ros.output(node).splitlines()[printed:]
    assert len(lines) <= 10 * _most_warnings(began_s), lines[:20]  # tf2 prints two for each of a thousand
    assert node.poll() is None
    assert set(objects(ros)) == {"lost", "follower", "ball", "iiwa"}


def test_object_added_again_follows_its_static_frame(ros, node):
    shelf_height_m = 2.0
    shelf = {**FLOOR, "name": "shelf", "object_tf": {"tf_id": "shelf_frame", "hz": 100}}
    probe = ball("probe", basePosition=[3.0, 0.0, 4.0], resetBaseVelocity={"linearVelocity": [0.0, 0.0, -4.0]})
    ros.start(["rosrun", "tf2_ros", "static_transform_publisher", *"0 0 2 0 0 0 rpbi/world shelf_frame".split()])
    tf = ros.listen("/tf", TFMessage)

    def is_in_the_way():
        assert add(ros, PybulletObject.COLLISION, shelf).success
        del tf.messages[:]
        assert add(ros, PybulletObject.DYNAMIC, {**probe, "broadcast_hz": 100}).success
        heights_m = wait_until(lambda: _heights_m(tf, "rpbi/probe", 130), "the ball has had time to fall")
        for name in ("probe", "shelf"):
            assert remove(ros, name).success
        return heights_m[-1] > shelf_height_m

    wait_until(is_in_the_way, "the frame is known, and the shelf follows it")
    # On a busy machine the ball may be sooner than the look at the frame
    wait_until(is_in_the_way, "the shelf is in its way again")


def _heights_m(tf, frame, least):
    """Returns the heights of a frame [m], None as long as there are fewer than asked for."""
    transforms = [transform for message in list(tf.messages) for transform in message.transforms]
    heights_m = [each.transform.translation.z for each in transforms if each.child_frame_id == frame]
    return heights_m if len(heights_m) >= least else None


def test_a_flood_of_messages_does_not_hold_the_loop_up(ros, target):
    diagnostics = ros.listen("/diagnostics", DiagnosticArray)

    def keeps_up():
        for _ in range(20):
            target.publish(JointState(name=["elbow"] * 50, position=[math.nan] * 50))
        # The first one may tell of the time before, and each tells of a second, of which others may take some
        return any(float(diagnosed(message)["real_time_factor"]) > 0.9 for message in diagnostics.messages[2:])

    wait_until(keeps_up, "it goes at its rate meanwhile")
