"""`avatar_node.py` and `segment_forces_node.py`: a person's segments move their avatar in the running simulator."""

from __future__ import annotations

import math
import subprocess

import numpy as np
import pytest
import rospy
from avatar_message import HEIGHT_M, message
from geometry_msgs.msg import PoseArray, Vector3
from node_world import Rosout, main_config, publishing
from ros_system import find_executable, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from worlds import box

from operator_node.avatar.anthropometry import segment_offsets
from operator_node.avatar.human_urdf import urdf_offsets
from operator_node.msg import SegmentForces
from operator_node.mvn.segments import SEGMENTS
from ros_pybullet_interface.msg import ContactPoint, Contacts

HUMAN = {
    "name": "human",
    "loadURDF": {
        "fileName": "{rpbi_examples}/robots/human_model.urdf",
        "basePosition": [0, 0, 0.93],
        "useFixedBase": True,
    },
    "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
    "object_tf": {"tf_id": "human/base", "hz": 60},
    "broadcast_link_states": True,
    "contacts": {"hz": 50},
}
HINGE = "jRightElbow_rotz"
MAX_JOINT_SPEED = 4.0
LOAD_KG = 0.5
FOREARM = SEGMENTS.index("RightForeArm")


@pytest.fixture(scope="module")
def avatar(module_ros, tmp_path_factory):
    """The avatar in a world, with a box on its right forearm, and its nodes."""
    ros = module_ros
    hand_x, arm_y, arm_z = 0.0, -(0.129 + 0.186 + 0.073) * HEIGHT_M, 0.93 + (0.818 - 0.53) * HEIGHT_M
    load = box("load", (0.03, 0.03, 0.03), baseMass=LOAD_KG, basePosition=[hand_x, arm_y, arm_z + 0.07])
    load["changeDynamics"] = {"lateralFriction": 1.0}
    ros.simulator(main_config(tmp_path_factory.mktemp("world"), robots=(HUMAN,), dynamic=(load,), timeStep=0.004))
    ros.avatar_log = ros.start(["rosrun", "operator_node", "avatar_node.py", f"_max_joint_speed:={MAX_JOINT_SPEED}"])
    ros.start(["rosrun", "operator_node", "segment_forces_node.py"])
    with publishing("/mvn/segments", PoseArray) as publisher:
        ros.send = publisher.publish
        yield ros


def follow(ros, hinges, position, condition, what):
    """Sends one pose until a condition holds."""

    def is_so():
        ros.send(message(hinges, position))
        rospy.rostime.wallsleep(0.01)
        return condition()

    wait_until(is_so, what, every_s=0.0)


def test_carried_load_is_measured_at_the_forearm(avatar):
    forces = avatar.listen("avatar/segment_forces", SegmentForces)

    def carries() -> bool:
        newest = np.array([each.forces[FOREARM].z for each in forces.messages[-10:]])
        return len(newest) == 10 and abs(newest.mean() + LOAD_KG * 9.81) < 0.05 * LOAD_KG * 9.81

    wait_until(carries, "the forearm feels the weight")
    assert forces.messages[-1].segments == list(SEGMENTS)
    newest = forces.messages[-1]
    assert newest.sums[FOREARM] >= newest.largest[FOREARM] > 0.0
    others = [n for n in range(len(SEGMENTS)) if n != FOREARM]
    assert not any(newest.forces[n].z or newest.sums[n] or newest.largest[n] for n in others)


def test_squeeze_sums_magnitudes_and_cancels_as_a_vector(avatar):
    forces = avatar.listen("avatar/segment_forces", SegmentForces)
    own = ContactPoint(link="Head", other_body="human", normal=Vector3(1, 0, 0), normal_force=9.0)
    squeeze = [
        ContactPoint(link="RightHand", other_body="plate", normal=Vector3(0, side, 0), normal_force=40.0)
        for side in (-1, 1)
    ]
    hand, head = SEGMENTS.index("RightHand"), SEGMENTS.index("Head")
    with publishing("/rpbi/human/contacts", Contacts) as publisher:
        message = Contacts(points=[own, *squeeze])

        def found() -> list[SegmentForces]:
            publisher.publish(message)
            return [each for each in forces.messages if each.sums[hand]]

        wait_until(found, "the squeeze is summed up")
        squeezed = found()[0]
    assert (squeezed.sums[hand], squeezed.largest[hand], squeezed.sums[head]) == (80.0, 40.0, 0.0)
    assert squeezed.forces[hand] == Vector3(0.0, 0.0, 0.0)


def test_avatar_follows_the_person_without_jumps(avatar, own_tf):
    states = avatar.listen("rpbi/human/joint_states", JointState)
    targets = avatar.listen("rpbi/human/joint_states/target", JointState)
    place = (0.3, 0.2, 0.93)
    wait_until(lambda: states.is_connected and targets.is_connected, "the first target would be heard")

    def is_there() -> bool:
        position = dict(zip(states.messages[-1].name, states.messages[-1].position)) if states.messages else {}
        base, _ = own_tf.get_tf("rpbi/world", "rpbi/human/Pelvis")
        near = base is not None and math.dist(base, place) < 1e-3
        return near and abs(position.get(HINGE, 9.0) - 1.2) < 2e-3 and len(targets.messages) > 10

    start = states.wait_for()[-1]
    bends, times = [dict(zip(start.name, start.position))[HINGE]], [rospy.Time.now().to_sec()]
    follow(avatar, {HINGE: 1.2}, place, is_there, "elbow and base are where the person has them")
    bends += [dict(zip(each.name, each.position))[HINGE] for each in targets.messages]
    times += [each.header.stamp.to_sec() for each in targets.messages]
    ahead = np.diff(bends) - MAX_JOINT_SPEED * np.diff(times)
    assert ahead.max() < 2e-3, "no target is further away than the time since the one before it allows"


def test_silence_is_reported_and_the_pose_held_until_messages_return(avatar):
    log = Rosout(avatar)
    targets = avatar.listen("rpbi/human/joint_states/target", JointState)
    follow(avatar, {HINGE: 1.2}, (0.3, 0.2, 0.93), lambda: targets.messages, "it follows")
    log.wait_for(["/mvn/segments: no message for 0.5 s; the avatar holds its last pose"])
    count = len(targets.messages)
    follow(avatar, {HINGE: 1.2}, (0.3, 0.2, 0.93), lambda: len(targets.messages) > count, "it goes on")
    assert avatar.call("avatar/engage", Trigger).success


def test_invalid_messages_are_refused_and_named(avatar):
    log = Rosout(avatar)
    wrong = message({})
    wrong.poses[6].position.x = math.nan

    def told() -> bool:
        avatar.send(wrong)
        rospy.rostime.wallsleep(0.02)
        return bool(log.logs("Head: a number is not finite"))

    wait_until(told, "the segment is named", every_s=0.0)
    targets = avatar.listen("rpbi/human/joint_states/target", JointState)
    follow(avatar, {}, (0.0, 0.0, 0.93), lambda: targets.messages, "it follows what makes sense")


def test_the_command_measures_who_is_in_the_suit(avatar):
    """Somebody of 1.75 m, whatever height the command is told."""
    program = find_executable("operator_node", "human_urdf.py")
    command = [program, "--height", "1.8", "--mass", "55", "--measure", "/mvn/segments"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    def has_ended() -> bool:
        avatar.send(message({}))
        return process.poll() is not None

    wait_until(has_ended, "it has measured")
    printed, _ = process.communicate()
    assert process.returncode == 0 and "A person of 1.8 m and 55 kg" in printed
    assert urdf_offsets("printed", printed) == pytest.approx(segment_offsets(HEIGHT_M), abs=1e-5)
