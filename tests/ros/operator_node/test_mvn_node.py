"""`mvn_node.py` with the emulator and the player: TF, poses, joy, services, silence."""

from __future__ import annotations

import itertools
import re
from collections import deque
from io import BytesIO

import genpy
import numpy as np
import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, PointStamped, Pose, PoseArray, Quaternion, Transform, TransformStamped, Vector3
from mvn_stream import T_POSE, WALKER, Sender, assert_same, suit, truth
from ros_system import wait_until
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from operator_node.mvn.frame_messages import FramePacker
from operator_node.mvn.segments import SEGMENTS, SegmentFrame

STAMP = genpy.Time(3, 999_999_999)


def written(message) -> bytes:
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def test_packed_messages_have_the_bytes_that_their_types_write():
    frame = truth(100)
    transforms, poses = FramePacker("mvn/3", "rpbi/wörld").messages(frame, STAMP)
    rows = list(zip(frame.positions.tolist(), frame.quats_xyzw.tolist()))
    header = Header(0, STAMP, "rpbi/wörld")
    expected = [
        TransformStamped(header, f"mvn/3/{name}", Transform(Vector3(*position), Quaternion(*quat)))
        for name, (position, quat) in zip(SEGMENTS, rows)
    ]
    assert written(transforms) == written(TFMessage(expected))
    poses.header.seq = 7
    expected_poses = [Pose(Point(*position), Quaternion(*quat)) for position, quat in rows]
    assert written(poses) == written(PoseArray(Header(7, STAMP, "rpbi/wörld"), expected_poses))


@pytest.fixture(scope="module")
def node(module_ros):
    """The node on a port of the system's choice, whose log tells it."""
    folder = module_ros.folder / "recordings"
    rospy.set_param("/mvn", {"port": 0, "timeout_s": 0.3, "recording_folder": str(folder), "parent_frame_id": "lab"})
    process = module_ros.start(["rosrun", "operator_node", "mvn_node.py"])
    said = wait_until(
        lambda: re.search(r"listening at 127.0.0.1:(\d+)", module_ros.output(process)), "the node listens"
    )
    process.port = int(said[1])
    yield process
    rospy.delete_param("/mvn")


@pytest.fixture
def topics(module_ros, node):
    """All topics, connected."""
    types = {
        "/tf": TFMessage,
        "/mvn/segments": PoseArray,
        "/joy": Joy,
        "/mvn/markers": MarkerArray,
        "/diagnostics": DiagnosticArray,
    }
    listeners = {name: module_ros.listen(name, message_type) for name, message_type in types.items()}
    wait_until(lambda: all(each.is_connected for each in listeners.values()), "all topics are connected")
    yield listeners
    for each in listeners.values():
        each.close()


@pytest.fixture
def sender(node):
    sender = Sender(node.port)
    yield sender
    sender.close()


@pytest.mark.quick
def test_frames_become_tf_poses_and_joy_until_the_stream_ends(module_ros, topics, sender):
    tf, poses, joy = (topics[name] for name in ("/tf", "/mvn/segments", "/joy"))
    for sample in itertools.count(150, 6):  # hands count anew after each silence, also of a machine that stands still
        before = len(poses.messages)
        sender.send(*suit().datagrams(sample, sample / 60.0))
        poses.wait_for(before + 1)
        tf.wait_for(before + 1)
        if any(max(map(abs, each.axes)) > 0.02 for each in joy.messages):
            break
    assert joy.messages[0].axes == (0.0,) * 6
    (message,) = poses.messages[-1:]
    assert message.header.frame_id == "lab"
    transforms = tf.messages[-1].transforms
    assert [each.child_frame_id for each in transforms] == [f"mvn/0/{name}" for name in SEGMENTS]
    assert {(each.header.frame_id, each.header.stamp) for each in transforms} == {("lab", message.header.stamp)}
    for way in ([each.transform for each in transforms], message.poses):
        assert_same(_frame(way, truth(sample)), truth(sample))
    markers = topics["/mvn/markers"].wait_for(1)[0].markers
    assert {marker.ns for marker in markers} == {"person 0"} and all(marker.frame_locked for marker in markers)
    (thigh,) = (marker for marker in markers if marker.header.frame_id == "mvn/0/RightUpperLeg")
    assert thigh.points[1].z == pytest.approx(-0.245 * 1.75, abs=1e-3)

    wait_until(lambda: not any(joy.messages[-1].axes), "the hands are let go")
    count = len(poses.messages)
    wait_until(lambda: "no frame for 0.3 s" in module_ros.output(module_ros.processes[-1]), "a warning")
    status = wait_until(lambda: _status(topics, "no frames", frames=str(count)), "diagnostics tell")
    assert status["datagrams used"] == status["datagrams received"] == str(count)
    wait_until(lambda: topics["/mvn/markers"].messages[-1].markers[0].action == 2, "nobody is drawn any more")


def _frame(poses, like: SegmentFrame) -> SegmentFrame:
    def parts(pose):
        place = getattr(pose, "position", None) or pose.translation
        turn = getattr(pose, "orientation", None) or pose.rotation
        return (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w)

    positions, quats = zip(*map(parts, poses))
    return like._replace(positions=np.array(positions), quats_xyzw=np.array(quats))


def _status(topics, message, frames):
    """Returns the values of the newest diagnostics of the stream if they have a message, and tell of so many frames."""
    told = (each for array in topics["/diagnostics"].messages for each in array.status if each.name.endswith("stream"))
    for status in deque(told, maxlen=1):
        values = {each.key: each.value for each in status.values}
        return values if status.message.startswith(message) and values["frames"] == frames else None
    return None


def test_a_second_person_joint_angles_and_the_centre_of_mass(module_ros, node, sender):
    names = {"/mvn/1/segments": PoseArray, "/mvn/1/joint_angles": JointState, "/mvn/1/center_of_mass": PointStamped}
    listeners = [module_ros.listen(name, message_type) for name, message_type in names.items()]
    sample = iter(range(300, 100_000))

    def come():
        number = next(sample)
        for each in (suit(0), suit(1, kinds=(2, 12, 20, 24))):
            sender.send(*each.datagrams(number, number / 60.0))
        return all(each.messages for each in listeners)

    wait_until(come, "all of person 1 comes")
    assert len(listeners[1].messages[0].name) == 66 and "RightUpperArm_RightForeArm_z" in listeners[1].messages[0].name
    assert 0.5 < listeners[2].messages[0].point.z < 1.2


def test_calibration_and_recording_by_services(module_ros, node, sender):
    call = module_ros.call
    sample = iter(range(10_000, 100_000))

    def until(moves, service, service_type, *arguments):
        """Sends frames until a service has succeeded, whose answer it returns."""

        def asked():
            number = next(sample)
            sender.send(*suit(moves=moves).datagrams(number, number / 60.0))
            answer = call(service, service_type, *arguments)
            return answer if answer.success else None

        return wait_until(asked, f"{service} succeeds")

    assert "person 0" in until(T_POSE, "/mvn/calibrate", Trigger).message
    assert call("/mvn/clear_calibration", Trigger).success
    assert call("/mvn/record", SetBool, False).message == "nothing is being recorded"
    answer = call("/mvn/record", SetBool, True)
    assert answer.success and "recordings/mvn_" in answer.message
    assert "is being recorded already" in call("/mvn/record", SetBool, True).message
    path = answer.message.removeprefix("recording into ")
    for number in range(20_000, 20_040):
        sender.send(*suit(moves=WALKER).datagrams(number, number / 60.0))
    poses = module_ros.listen("/mvn/segments", PoseArray)
    until(T_POSE, "/mvn/calibrate", Trigger)
    answer = call("/mvn/record", SetBool, False)
    assert re.fullmatch(rf"{re.escape(path)} has \d+ datagrams", answer.message)
    wait_until(lambda: poses.is_connected, "poses are connected")
    player = module_ros.start(
        ["rosrun", "operator_node", "mvn_player.py", path, "--port", str(node.port), "__name:=player"]
    )
    assert player.wait(60.0) == 0, module_ros.output(player)
    assert module_ros.output(player).startswith("sent ")
    assert len(poses.wait_for(30)) >= 30
