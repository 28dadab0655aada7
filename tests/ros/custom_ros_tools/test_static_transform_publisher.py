"""The transform that is told again and again until a service replaces it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

import pytest
import rospy
from custom_srvs.srv import SetTransform
from geometry_msgs.msg import Quaternion, Transform, Vector3
from ros_system import stop_group, wait_until
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage

NAMES = ("resettable_static_transform_publisher", "resetable_static_transform_publisher")
QUARTER_TURN = Quaternion(0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))


def start(ros, *arguments: str, executable: str = NAMES[0]):
    """Starts the node."""
    return ros.start(["rosrun", "custom_ros_tools", executable, *arguments])


def of(message: TFMessage) -> Transform:
    """Returns the only transform in a message."""
    [transform] = message.transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("world", "box")
    return transform.transform


def stamp_of(message: TFMessage) -> rospy.Time:
    """Returns the stamp of the only transform in a message."""
    return message.transforms[0].header.stamp


def xyz(vector: Vector3) -> tuple[float, float, float]:
    """Returns a vector's components."""
    return vector.x, vector.y, vector.z


def xyzw(quat: Quaternion) -> tuple[float, float, float, float]:
    """Returns a quaternion's components."""
    return quat.x, quat.y, quat.z, quat.w


@pytest.mark.parametrize("executable", NAMES)
@pytest.mark.parametrize("rotation", ["0 0 1.5707963267948966", "0 0 1 1"], ids=["angles", "quaternion"])
def test_transform_of_the_arguments_is_published_with_new_stamps(ros, executable, rotation):
    start(ros, "1", "-2", "3", *rotation.split(), "world", "box", executable=executable)
    told = ros.listen("/tf", TFMessage).wait_for(20)
    assert xyz(of(told[0]).translation) == (1.0, -2.0, 3.0)
    assert xyzw(of(told[0]).rotation) == pytest.approx(xyzw(QUARTER_TURN))
    stamps = [stamp_of(message) for message in told]
    assert stamps == sorted(set(stamps)) and stamps[0] > rospy.Time(0)


@pytest.mark.quick
def test_service_replaces_the_transform(ros):
    start(ros, *"0 0 0 0 0 0 world box".split())
    heard = ros.listen("/tf", TFMessage)
    answer = ros.call("reset_tf", SetTransform, Transform(Vector3(1, 2, 3), Quaternion(0, 0, 5, 5)))
    assert (answer.success, answer.message) == (True, "transform set")
    wait_until(lambda: heard.messages and of(heard.messages[-1]).translation.x == 1.0, "the new one is told")
    assert xyz(of(heard.messages[-1]).translation) == (1.0, 2.0, 3.0)
    assert xyzw(of(heard.messages[-1]).rotation) == pytest.approx(xyzw(QUARTER_TURN)), "its length is 1"


def test_service_refuses_invalid_transforms_and_keeps_the_old_one(ros):
    start(ros, *"1 2 3 0 0 0 world box".split())
    heard = ros.listen("/tf", TFMessage)
    for transform, told in (
        (Transform(Vector3(math.nan, 0, 0), QUARTER_TURN), "position: must be finite, got nan, 0, 0"),
        (Transform(Vector3(0, 0, -math.inf), QUARTER_TURN), "position: must be finite, got 0, 0, -inf"),
        (Transform(Vector3(0, 0, 0), Quaternion(0, 0, 0, math.nan)), "quaternion: must be finite, got 0, 0, 0, nan"),
        (Transform(Vector3(9, 9, 9), Quaternion(0, 0, 0, 0)), "quaternion: must not be zero"),
    ):
        answer = ros.call("reset_tf", SetTransform, transform)
        assert not answer.success and told in answer.message
    count = len(heard.messages)
    assert {xyz(of(message).translation) for message in heard.wait_for(count + 20)} == {(1.0, 2.0, 3.0)}


LAUNCH = """
<launch>
  <node pkg="custom_ros_tools" type="{executable}" name="box_tf" args="1 2 3 0 0 0 world box">
    <param name="hz" value="500"/>
    <remap from="reset_tf" to="box/set"/>
  </node>
</launch>
"""


@pytest.mark.parametrize("executable", NAMES)
def test_arguments_that_roslaunch_adds_are_not_counted(ros, tmp_path, executable):
    """Defect 46: under roslaunch the release took name and remappings for arguments of its own."""
    (tmp_path / "box.launch").write_text(LAUNCH.format(executable=executable))
    ros.start(["roslaunch", str(tmp_path / "box.launch")])
    assert ros.call("/box/set", SetTransform, Transform(Vector3(7, 0, 0), QUARTER_TURN)).success
    heard = ros.listen("/tf", TFMessage)
    wait_until(lambda: heard.messages and of(heard.messages[-1]).translation.x == 7.0, "the new one is told")


def test_rate_equals_the_parameter(ros):
    rospy.set_param(f"/{NAMES[0]}/hz", 10)
    start(ros, *"0 0 0 0 0 0 world box".split())
    told = ros.listen("/tf", TFMessage).wait_for(21)
    assert (stamp_of(told[20]) - stamp_of(told[0])).to_sec() > 1.0, "at the default rate, that is 0.2 s"


@pytest.fixture
def clock(ros) -> Iterator[rospy.Publisher]:
    """A clock that moves only when it is told to."""
    rospy.set_param("/use_sim_time", True)
    publisher = rospy.Publisher("/clock", Clock, latch=True, queue_size=1)
    yield publisher
    publisher.unregister()


@pytest.mark.parametrize("stamp", [rospy.Time(0), rospy.Time(5, 0)], ids=["no clock", "paused clock"])
def test_late_listener_hears_once_while_simulated_time_is_paused(ros, clock, stamp):
    """Stamps that repeat would make each listener warn a hundred times a second."""
    if stamp:
        clock.publish(stamp)
    start(ros, *"1 2 3 0 0 0 world box".split())
    early = ros.listen("/tf", TFMessage)
    wait_until(lambda: early.messages and stamp_of(early.messages[-1]) == stamp, "it has the clock's stamp")
    late = ros.listen("/tf", TFMessage)
    assert xyz(of(late.wait_for(1)[0]).translation) == (1.0, 2.0, 3.0)
    time.sleep(0.3)  # some thirty periods
    assert len(late.messages) == 1
    clock.publish(rospy.Time(6, 0))
    wait_until(lambda: stamp_of(late.messages[-1]) == rospy.Time(6, 0), "it goes on with the clock")


def test_transform_set_while_time_is_paused_reaches_late_listeners(ros, clock):
    clock.publish(rospy.Time(5, 0))
    start(ros, *"1 2 3 0 0 0 world box".split())
    assert ros.call("reset_tf", SetTransform, Transform(Vector3(4, 5, 6), QUARTER_TURN)).success
    late = ros.listen("/tf", TFMessage)
    wait_until(lambda: late.messages and of(late.messages[-1]).translation.x == 4.0, "the new one is told")


@pytest.mark.parametrize(
    ("arguments", "parameters", "told"),
    [
        ("1 2 3 world box", {}, "got 5 arguments"),
        ("a 0 0 0 0 0 world box", {}, "arguments: x: expected a number, got 'a'"),
        ("0 0 0 nan 0 0 world box", {}, "must be finite"),
        ("0 0 0 0 0 0 world box", {"hz": 0}, f"/{NAMES[0]}: hz: must be > 0 [Hz], got 0"),
        ("0 0 0 0 0 0 world box", {"hz": "fast"}, "hz: expected a number [Hz], got text 'fast'"),
        ("a 0 0 0 0 0 world box", {"hz": 0}, f"/{NAMES[0]}: hz: must be > 0 [Hz], got 0"),
    ],
)
def test_wrong_arguments_and_parameters_are_named_and_end_the_node(ros, arguments, parameters, told):
    for key, value in parameters.items():
        rospy.set_param(f"/{NAMES[0]}/{key}", value)
    process = start(ros, *arguments.split())
    assert process.wait(60.0) == 1
    assert told in ros.output(process) and "Traceback" not in ros.output(process)


def test_ctrl_c_ends_it_cleanly_at_a_high_rate(ros):
    rospy.set_param(f"/{NAMES[0]}/hz", 2000)
    process = start(ros, *"0 0 0 0 0 0 world box".split())
    ros.listen("/tf", TFMessage).wait_for(100)
    assert stop_group(process) == 0
    assert "Traceback" not in ros.output(process)
