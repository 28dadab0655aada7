"""Bases over ROS: driving by `cmd_vel`, `base_state`, the root frame, and a base that follows TF."""

from __future__ import annotations

import math

import pytest
import rospy
from custom_srvs.srv import SetTransform, SetTransformRequest
from geometry_msgs.msg import TransformStamped, Twist
from mobile_base import mobile_base
from nav_msgs.msg import Odometry
from node_world import Rosout, main_config, publishing, registrations, remove
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from tf2_ros import StaticTransformBroadcaster
from worlds import FLOOR

from ros_pybullet_interface.srv import RobotInfo

HZ = 40
TICKS_A_SECOND = 500


def _start(ros, **more):
    """Starts a world with the mobile base, five times as fast as real time, and listens to its state."""
    robot = mobile_base(ros.folder, base_state_hz=HZ, **more)
    config = main_config(
        ros.folder,
        collision=(FLOOR,),
        robots=(robot,),
        timeStep=1.0 / TICKS_A_SECOND,
        real_time_factor=5,
    )
    ros.simulator(config, use_sim_time=True)
    states = ros.listen("/rpbi/mobile/base_state", Odometry)
    states.wait_for(1)
    return states


def _twist(x=0.0, y=0.0, yaw=0.0):
    message = Twist()
    message.linear.x, message.linear.y, message.angular.z = x, y, yaw
    return message


def _speed(state):
    return math.hypot(state.twist.twist.linear.x, state.twist.twist.linear.y)


def test_base_state_is_an_odometry_at_its_rate(ros):
    states = _start(ros, loadURDF={"basePosition": [1.0, 2.0, 0.0], "baseOrientation": [0.0, 0.0, 0.6, 0.8]})
    states.wait_for(200)
    state = states.messages[0]
    assert (state.header.frame_id, state.child_frame_id) == ("rpbi/world", "rpbi/mobile/base_link")
    position, quat = state.pose.pose.position, state.pose.pose.orientation
    assert (position.x, position.y, position.z) == pytest.approx((1.0, 2.0, 0.0), abs=1e-6)
    assert (quat.x, quat.y, quat.z, quat.w) == pytest.approx((0.0, 0.0, 0.6, 0.8), abs=1e-6)
    stamps = states.stamps_ns[:200]
    gaps = [later - earlier for earlier, later in zip(stamps, stamps[1:])]
    tick_ns = 1_000_000_000 // TICKS_A_SECOND
    assert sum(gaps) / len(gaps) == pytest.approx(1e9 / HZ, rel=0.01)
    assert max(abs(gap - 1e9 / HZ) for gap in gaps) <= tick_ns


@pytest.mark.quick
def test_commands_drive_it_and_without_them_it_brakes(ros):
    states = _start(ros, planar_base={"cmd_vel_timeout_s": 1.0})
    with publishing("/rpbi/mobile/cmd_vel", Twist) as commands:
        wait_until(lambda: commands.publish(_twist(x=0.4)) or _speed(states.messages[-1]) > 0.399, "it drives")
    moved_at = states.messages[-1]
    assert moved_at.pose.pose.position.x > 0.0
    wait_until(lambda: _speed(states.messages[-1]) < 1e-3, "it has braked")


def test_bad_velocities_are_refused_and_the_last_valid_one_holds(ros):
    rosout = Rosout(ros)
    states = _start(ros, planar_base={"cmd_vel_timeout_s": 1.0e6})
    with publishing("/rpbi/mobile/cmd_vel", Twist) as commands:
        commands.publish(_twist(y=0.3))
        wait_until(lambda: _speed(states.messages[-1]) > 0.299, "it drives")
        commands.publish(_twist(x=math.nan))
        rosout.wait_for(["/rpbi/mobile/cmd_vel: message refused: velocities must be finite, got linear.x=nan"])
        climbing = _twist()
        climbing.linear.z = 1.0
        commands.publish(climbing)
        count = len(states.messages)
        states.wait_for(count + 10 * HZ)
    assert all(_speed(state) > 0.299 for state in states.messages[count:])
    assert states.messages[-1].pose.pose.position.z == 0.0


def test_joints_that_move_the_base_are_not_published(ros):
    _start(ros)
    joint_states = ros.listen("/rpbi/mobile/joint_states", JointState)
    assert joint_states.wait_for(1)[0].name == ["shoulder"]
    info = ros.call("/rpbi/mobile/robot_info", RobotInfo)
    assert (info.root_link_name, info.numJoints, info.numDof) == ("base_link", 1, 1)
    assert [joint.jointName for joint in info.joint_info] == ["shoulder"]
    with publishing("/rpbi/mobile/joint_states/target", JointState) as targets:
        wait_until(
            lambda: (
                targets.publish(JointState(name=["shoulder"], position=[0.7]))
                or joint_states.messages[-1].position[0] == pytest.approx(0.7, abs=1e-3)
            ),
            "the arm has moved",
        )


def test_only_the_root_frame_is_on_tf_at_its_state(ros):
    states = _start(ros, broadcast_root_tf_hz=HZ)
    transforms = ros.listen("/tf", TFMessage)
    with publishing("/rpbi/mobile/cmd_vel", Twist) as commands:
        wait_until(lambda: commands.publish(_twist(x=0.3, yaw=0.5)) or _speed(states.messages[-1]) > 0.29, "it drives")
    transforms.wait_for(len(transforms.messages) + HZ)
    last = transforms.messages[-1].transforms[0].header.stamp
    wait_until(lambda: states.messages[-1].header.stamp >= last, "the states of these times have come")
    ros.call("/rpbi/stop", Trigger)
    told = [one for message in list(transforms.messages) for one in message.transforms]
    assert {(one.header.frame_id, one.child_frame_id) for one in told} == {("rpbi/world", "rpbi/mobile/base_link")}
    places = {state.header.stamp.to_nsec(): state.pose.pose.position for state in states.messages}
    compared = 0
    for one in told:
        place = places.get(one.header.stamp.to_nsec())
        if place is not None:
            compared += 1
            translation = one.transform.translation
            assert (translation.x, translation.y, translation.z) == (place.x, place.y, place.z)
    assert compared > 10


def test_it_can_be_put_elsewhere_by_service(ros):
    states = _start(ros)
    request = SetTransformRequest()
    request.transform.translation.x, request.transform.translation.y = 2.0, -3.0
    request.transform.rotation.z = 1.0
    assert ros.call("/rpbi/mobile/set_pose", SetTransform, request).success
    wait_until(lambda: states.messages[-1].pose.pose.position.x > 1.0, "it is there")
    count = len(states.messages)
    state = states.wait_for(count + HZ)[-1]
    assert (state.pose.pose.position.x, state.pose.pose.position.y) == pytest.approx((2.0, -3.0), abs=1e-6)
    assert abs(state.pose.pose.orientation.z) == pytest.approx(1.0, abs=1e-6)


def test_fixed_base_follows_its_tf_frame(ros):
    more = {"loadURDF": {"useFixedBase": True}, "object_tf": {"tf_id": "carrier", "hz": 50}, "planar_base": None}
    states = _start(ros, **more)
    assert states.messages[0].pose.pose.position.x == pytest.approx(0.0, abs=1e-6)
    carrier = TransformStamped(child_frame_id="carrier")
    carrier.header.frame_id, carrier.header.stamp = "rpbi/world", rospy.Time(1)
    carrier.transform.translation.x, carrier.transform.translation.z = 1.5, 0.4
    carrier.transform.rotation.x = carrier.transform.rotation.w = math.sqrt(0.5)
    broadcaster = StaticTransformBroadcaster()
    broadcaster.sendTransform(carrier)
    wait_until(lambda: states.messages[-1].pose.pose.position.x > 1.0, "the base has moved")
    broadcaster.pub_tf.unregister()  # else this process goes on telling it, to all tests to come
    pose = states.messages[-1].pose.pose
    assert (pose.position.x, pose.position.y, pose.position.z) == pytest.approx((1.5, 0.0, 0.4), abs=1e-6)
    assert (pose.orientation.x, pose.orientation.w) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)), abs=1e-6)


def test_its_topics_go_with_it(ros):
    _start(ros)
    ours = {("publishes", "/rpbi/mobile/base_state"), ("subscribes", "/rpbi/mobile/cmd_vel")}
    assert ours <= set(registrations())
    assert remove(ros, "mobile").success
    wait_until(lambda: not ours & set(registrations()), "the topics are gone")
