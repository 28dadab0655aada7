"""Nodes that hand joint states on, as numbers or as they are, while they are switched on."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
import rospy
from node_world import Rosout, publishing
from ros_system import stop_group, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool

ARRAY_NODE = "remap_joint_state_to_floatarray"
STATE = JointState(name=["a", "b", "c"], position=[1.0, 2.0, 3.0], velocity=[4.0, 5.0, 6.0])


@pytest.fixture
def start(ros) -> Callable[..., Any]:
    """Starts one of the nodes and waits until it can be switched."""

    def run(executable: str, *arguments: str, toggle: str = "remap_joint_state/toggle", **parameters: Any) -> Any:
        default_name = ARRAY_NODE if executable == ARRAY_NODE else "remap_joint_state_to_joint_state"
        for name, value in parameters.items():
            rospy.set_param(f"/{default_name}/{name}", value)
        process = ros.start(["rosrun", "custom_ros_tools", executable, *arguments])
        rospy.wait_for_service(toggle, timeout=60.0)
        return process

    return run


def toggle(ros, to: bool, service: str = "remap_joint_state/toggle") -> tuple[bool, str]:
    """Switches a node on or off and returns its answer."""
    answer = ros.call(service, SetBool, to)
    return answer.success, answer.message


def repeat(publisher: rospy.Publisher, message: Any, condition: Callable[[], Any], what: str) -> None:
    """Publishes a message until a condition holds."""
    wait_until(lambda: publisher.publish(message) or condition(), what)


@pytest.mark.quick
def test_numbers_come_in_the_order_of_the_configuration(ros, start):
    start(ARRAY_NODE, config={"joint_names": ["c", "a"], "field": "velocity"}, start_on_init=True)
    numbers = ros.listen("joint_states/floatarray", Float64MultiArray)
    with publishing("joint_states", JointState) as states:
        repeat(states, STATE, lambda: numbers.messages, "numbers come")
    assert numbers.messages[0].data == (6.0, 4.0)


def test_without_a_configuration_all_positions_come_as_they_are(ros, start):
    start(ARRAY_NODE, start_on_init=True)
    numbers = ros.listen("joint_states/floatarray", Float64MultiArray)
    with publishing("joint_states", JointState) as states:
        repeat(states, STATE, lambda: numbers.messages, "numbers come")
    assert numbers.messages[0].data == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("message", "told"),
    [
        (JointState(name=["a", "c"], position=[1.0, 3.0]), "no values for joint 'b': it has a, c"),
        (JointState(name=["a", "b"], position=[1.0, math.nan]), "values must be finite, got position 1, nan"),
        (JointState(name=["a", "b"], velocity=[1.0, 2.0]), "expected position, got none"),
    ],
    ids=["missing joint", "not a number", "other quantity"],
)
def test_message_that_cannot_be_remapped_is_refused_with_its_topic(ros, start, message, told):
    rosout = Rosout(ros)
    start(ARRAY_NODE, config={"joint_names": ["b", "a"]}, start_on_init=True)
    numbers = ros.listen("joint_states/floatarray", Float64MultiArray)
    with publishing("joint_states", JointState) as states:
        repeat(states, message, lambda: rosout.logs(told), "it is refused")
        repeat(states, STATE, lambda: numbers.messages, "numbers come")
    assert {number.data for number in numbers.messages} == {(2.0, 1.0)}
    assert rosout.logs(told)[0].msg == f"/joint_states: message refused: {told}"
    assert rosout.is_throttled(told), "once, not each time"


def test_not_a_number_in_another_quantity_does_not_matter(ros, start):
    """Drivers that do not measure efforts send NaN."""
    start(ARRAY_NODE, start_on_init=True)
    numbers = ros.listen("joint_states/floatarray", Float64MultiArray)
    with publishing("joint_states", JointState) as states:
        message = JointState(name=["a"], position=[1.0], effort=[math.nan])
        repeat(states, message, lambda: numbers.messages, "numbers come")


@pytest.mark.parametrize(
    ("executable", "services"),
    [
        (ARRAY_NODE, ["remap_joint_state/toggle", f"{ARRAY_NODE}/toggle"]),
        ("remap_joint_state", ["remap_joint_state/toggle", "remap_joint_state_to_joint_state/toggle"]),
        (
            "remap_joint_state_to_joint_state",
            ["remap_joint_state/toggle", "remap_joint_state_to_joint_state/toggle"],
        ),
    ],
)
def test_both_service_names_switch_remapping_and_refuse_repetition(ros, start, executable, services):
    """Defect 52: clients of the release wait for names that it did not offer."""
    start(executable)
    for one, other in (services, services[::-1]):
        assert toggle(ros, False, one) == (False, "remapping is already off")
        assert toggle(ros, True, one) == (True, "remapping is on")
        assert toggle(ros, True, other) == (False, "remapping is already on")
        assert toggle(ros, False, other) == (True, "remapping is off")


@pytest.mark.parametrize("executable", ["remap_joint_state", "remap_joint_state_to_joint_state"])
def test_joint_states_pass_unchanged_only_while_remapping_is_on(ros, start, executable):
    start(executable)
    passed = ros.listen("joint_states/to", JointState)
    source = rospy.Publisher("joint_states/from", JointState, queue_size=10)
    message = JointState(name=["a", "b"], position=[1.0, 2.0], effort=[3.0, 4.0])
    message.header.frame_id, message.header.stamp = "arm", rospy.Time(12, 34)
    for _ in range(2):
        passed.messages.clear()
        assert source.get_num_connections() == 0, "off, it does not even listen"
        assert toggle(ros, True)[0]
        repeat(source, message, lambda: passed.messages, "a message passes")
        message.header.seq = passed.messages[0].header.seq
        assert passed.messages[0] == message
        assert toggle(ros, False)[0]
        wait_until(lambda: source.get_num_connections() == 0, "it listens no more")
    source.unregister()


def test_faulty_joint_state_does_not_pass(ros, start):
    rosout = Rosout(ros)
    start("remap_joint_state", start_on_init=True)
    passed = ros.listen("joint_states/to", JointState)
    with publishing("joint_states/from", JointState) as source:
        faulty = JointState(name=["a"], position=[math.inf])
        told = "/joint_states/from: message refused: values must be finite, got position inf"
        repeat(source, faulty, lambda: rosout.logs(told), "it is refused")
        repeat(source, STATE, lambda: passed.messages, "a sound one passes")
    assert {message.name[0] for message in passed.messages} == {"a"} and passed.messages[0].position == (1.0, 2.0, 3.0)


def test_it_is_not_switched_on_while_the_robot_is_elsewhere(ros, start):
    joints = [{"joint": "a", "rename": "A1", "unit": "deg"}]
    near = {"topic": "robot/joint_states", "tolerance": 0.1}
    start(ARRAY_NODE, config={"joint_names": ["b", "a"], "joints": joints, "start_within": near})
    stays_off = "remapping stays off: "
    missing = "no joint states came on /robot/joint_states within 2 s"
    assert toggle(ros, True) == (False, f"{stays_off}{missing}")
    states, robot = (
        rospy.Publisher(name, JointState, queue_size=1, latch=True) for name in ("joint_states", near["topic"])
    )
    states.publish(STATE)
    robot.publish(JointState(name=["b", "A1"], position=[2.05, 60.0]))

    def switched_on() -> tuple[bool, str] | None:
        """Returns the answer, None if a state took longer than 2 s, as it may on a busy machine."""
        answer = toggle(ros, True)
        return None if "no joint states came on" in answer[1] else answer

    assert wait_until(switched_on, "states come") == (True, "remapping is on")
    toggle(ros, False)
    robot.publish(JointState(name=["b", "A1"], position=[2.05, 70.0]))
    where = "joint 'a' of the robot is at 1.222 and would be commanded to 1: expected them within 0.1"
    assert wait_until(switched_on, "states come") == (False, f"{stays_off}{where}")
    robot.publish(JointState(name=["b"], position=[2.05]))
    assert "no values for joint 'A1'" in wait_until(switched_on, "states come")[1]
    states.unregister()
    robot.unregister()


def test_names_and_units_of_a_driver_there_and_back(ros, start):
    """Both nodes on one topic: the second undoes what the first does, and numbers are in the driver's units."""
    joints = [{"joint": "a", "rename": "A1", "unit": "deg", "sign": -1, "offset": 90.0}]
    start("remap_joint_state", config={"joint_names": ["c", "a"], "joints": joints}, start_on_init=True)
    back = ["joint_states:=joint_states/to", "remap_joint_state/toggle:=back/toggle"]
    start(
        ARRAY_NODE,
        *back,
        toggle="back/toggle",
        config={"joint_names": ["c", "A1"], "joints": joints, "inverse": True},
        start_on_init=True,
    )
    there, numbers = ros.listen("joint_states/to", JointState), ros.listen("joint_states/floatarray", Float64MultiArray)
    with publishing("joint_states/from", JointState) as states:
        repeat(states, STATE, lambda: there.messages and numbers.messages, "both have something")
    assert there.messages[0].name == ["c", "A1"]
    assert there.messages[0].position == pytest.approx((3.0, 90.0 - math.degrees(1.0)))
    assert there.messages[0].velocity == pytest.approx((6.0, -math.degrees(4.0)))
    assert numbers.messages[0].data == pytest.approx((3.0, 1.0), rel=1e-14)


LAUNCH = """
<launch>
  <node pkg="custom_ros_tools" type="remap_joint_state" name="to_arm" ns="arm">
    <param name="start_on_init" value="true"/>
    <remap from="joint_states/from" to="/rpbi/kuka/joint_states"/>
    <remap from="joint_states/to" to="command"/>
    <remap from="remap_joint_state/toggle" to="connect"/>
  </node>
  <node pkg="custom_ros_tools" type="remap_joint_state_to_floatarray" name="to_hand" ns="hand">
    <rosparam>{start_on_init: true, config: {joint_names: [b], field: position}}</rosparam>
    <remap from="joint_states" to="/rpbi/kuka/joint_states"/>
  </node>
</launch>
"""


def test_roslaunch_names_and_remaps_everything(ros, tmp_path):
    (tmp_path / "two.launch").write_text(LAUNCH)
    ros.start(["roslaunch", str(tmp_path / "two.launch")])
    command = ros.listen("/arm/command", JointState)
    numbers = ros.listen("/hand/joint_states/floatarray", Float64MultiArray)
    with publishing("/rpbi/kuka/joint_states", JointState) as states:
        repeat(states, STATE, lambda: command.messages and numbers.messages, "both have something")
    assert numbers.messages[0].data == (2.0,)
    assert toggle(ros, True, "/arm/connect") == (False, "remapping is already on")


@pytest.mark.parametrize(
    ("executable", "parameters", "told"),
    [
        (ARRAY_NODE, {"config": {"field": "torque"}}, "~config: field: must be 'position', 'velocity' or 'effort'"),
        (ARRAY_NODE, {"config": "a"}, "~config: expected a mapping of keys to values, got str"),
        (ARRAY_NODE, {"config": "a", "start_on_init": "on"}, f"/{ARRAY_NODE}: start_on_init: expected true or false"),
        (ARRAY_NODE, {"start_on_init": "on"}, f"/{ARRAY_NODE}: start_on_init: expected true or false, got text 'on'"),
        ("remap_joint_state", {"config": {"joints": [{"joint": "a", "sign": 0}]}}, "~config: joints[0].sign: must be"),
        ("remap_joint_state", {"start_on_init": 2}, "start_on_init: expected true or false, got 2"),
    ],
)
def test_wrong_configuration_is_named_and_ends_the_node(ros, executable, parameters, told):
    for name in (ARRAY_NODE, "remap_joint_state_to_joint_state"):
        for key, value in parameters.items():
            rospy.set_param(f"/{name}/{key}", value)
    process = ros.start(["rosrun", "custom_ros_tools", executable])
    assert process.wait(60.0) == 1
    assert told in ros.output(process) and "Traceback" not in ros.output(process)


@pytest.mark.parametrize("executable", [ARRAY_NODE, "remap_joint_state"])
def test_ctrl_c_ends_it_cleanly_while_messages_flow(ros, start, executable):
    process = start(executable, "joint_states/from:=joint_states", start_on_init=True)
    with publishing("joint_states", JointState) as states:
        for _ in range(1000):
            states.publish(STATE)
        assert stop_group(process) == 0
    assert "Traceback" not in ros.output(process)
