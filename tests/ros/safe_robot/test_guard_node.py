"""Guards' nodes, two on one master, between a program that sends targets and one that takes commands."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from guard_nodes import NAMES, GuardStation
from guarded_arm import FOLDING, SLIDER
from node_world import Rosout, publishing
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from custom_ros_tools.errors import ConfigError
from safe_robot.check import CheckContext
from safe_robot.ros.guard_status import GuardStatus
from safe_robot.ros.parameters import guard_of_parameters


@pytest.fixture(scope="module")
def stations(module_ros) -> Iterator[tuple[GuardStation, GuardStation]]:
    """One that takes the first target's word for where the robot is, and one that asks for measured positions."""
    patient = {"limits": {"velocity": 1.0}, "checks": {"staleness": {"timeout_s": 60.0}}}
    left = GuardStation(module_ros, "/left", start_from="target", period_s=0.01, **patient)
    right = GuardStation(module_ros, "/right", period_s=0.2, publish_as_joint_state=False, **patient)
    yield left, right
    left.close()
    right.close()


@pytest.fixture
def left(stations) -> GuardStation:
    stations[0].wait()
    return stations[0]


@pytest.fixture
def right(stations) -> GuardStation:
    stations[1].wait()
    return stations[1]


def same(command: JointState, sent: JointState) -> bool:
    """Tells whether a message is another, but for its number, which ROS gives anew."""
    command.header.seq = sent.header.seq
    return command == sent


@pytest.mark.quick
def test_targets_pass_until_one_is_unsafe_and_after_a_restart(left):
    sent = []
    for k in range(5):
        sent.append(left.send(0.001 * k, -0.002 * k))
        assert same(left.commands.wait_for(k + 1)[k], sent[k])
    assert all(each.is_safe for each in left.statuses.wait_for(5))
    bad = left.send(0.5, 0.0)
    status = left.statuses.wait_for(6)[5]
    assert (status.is_safe, status.header.stamp) == (False, bad.header.stamp)
    assert status.message.startswith("joint_velocity: joint 'slide': velocity is ")
    violation = left.violations.wait_for()[0]
    assert (violation.check, violation.subject, violation.limit) == ("joint_velocity", "joint 'slide'", 0.95)
    left.send(0.004, -0.008)
    assert left.call("start").success
    assert not left.call("start").success
    again = left.send(0.004, -0.008)
    assert same(left.commands.wait_for(6)[5], again) and len(left.statuses.wait_for(7)) == 7
    assert left.call("stop").success
    assert not left.call("stop").success


@pytest.mark.parametrize(
    "fields, words",
    [
        ({"position": (0.0, float("nan"))}, "values must be finite"),
        ({"name": ["slide"], "position": (0.0,)}, "no values for joint 'turn'"),
        ({"name": ["slide", "turn", "more"], "position": (0.0, 0.0, 0.0)}, "'more' too"),
        ({"effort": (1.0, 1.0)}, "expected no efforts"),
        ({"velocity": (9.0, 0.0)}, "joint 'slide': expected a velocity within 0.95, got 9"),
        ({"age_s": 100.0}, "staleness: the "),
        (
            {"age_s": -100.0},
            "staleness: the stamp of the target is 100 s in the future, limit 60 s; synchronise the clocks",
        ),
    ],
)
def test_invalid_target_is_refused_and_named(left, fields, words):
    left.send(*fields.pop("position", (0.0, 0.0)), **fields)
    status = left.statuses.wait_for()[0]
    assert not status.is_safe and words in status.message
    assert left.commands.messages == []


def test_targets_of_one_stamp_are_commanded_once(left):
    first = left.send(0.0, 0.0)
    repeated = JointState(first.header, NAMES, [0.9, 0.0], [], [])
    left.publish(repeated)
    left.send(0.001, 0.0)
    statuses = left.statuses.wait_for(3)
    assert [each.is_safe for each in statuses] == [True] * 3
    assert [bool(each.message) for each in statuses] == [False, True, False]
    assert [each.position for each in left.commands.wait_for(2)] == [(0.0, 0.0), (0.001, 0.0)]


def test_target_without_a_stamp_after_stamped_ones_is_refused(left):
    """ROS time that begins anew at 0 looks like that."""
    left.send(0.0, 0.0)
    left.commands.wait_for()
    left.send_unstamped(0.001, 0.0)
    assert "expected a stamp" in left.statuses.wait_for(2)[1].message
    assert len(left.commands.messages) == 1


def test_target_after_a_late_one_does_not_jump(left):
    """The late target reveals nothing of a clock: the next one is as much nearer to the present."""
    left.send(0.0, 0.0, age_s=3.0)
    left.send(0.001, 0.0, age_s=0.0)
    assert all(each.is_safe for each in left.statuses.wait_for(2))
    left.send(0.002, 0.0, age_s=-3.0)
    assert "input: stamps jump by 3.0" in left.statuses.wait_for(3)[2].message


def test_limiting_guard_follows_again_after_stamps_have_jumped(ros):
    patient = {"checks": {"staleness": {"timeout_s": 60.0}}}
    guard = GuardStation(ros, "/jumping", start_from="target", period_s=0.01, policy="limit", **patient)
    guard.wait()
    for k, age_s in enumerate((0.0, -3.0, -3.0)):
        guard.send(0.0, 0.0, age_s=age_s)
        guard.statuses.wait_for(k + 1)
    assert [each.is_safe for each in guard.statuses.messages] == [True, False, True]
    guard.close()


def test_measured_states_of_other_joints_are_refused_with_their_names(module_ros, right):
    heard = Rosout(module_ros)
    other = JointState(name=["shoulder", "wrist"], position=[0.3, -0.2])
    refused = (
        "/right/joint_states/measured: message refused: no values for joints 'slide', 'turn': it has shoulder, wrist"
    )
    with publishing("/right/joint_states/measured", JointState) as measured:
        wait_until(lambda: measured.publish(other) or heard.logs(refused), "it is told", every_s=0.25)
    right.send(0.3, -0.2)
    assert "start: no measured positions of all guarded joints on " in right.statuses.wait_for()[0].message


def test_commands_are_ordered_a_period_apart_from_the_measured_position(left, right):
    """Late targets that come together make the robot no faster; and what one guard is told another does not hear."""
    right.send(0.3, -0.2)
    assert "start: no measured positions of all guarded joints on " in right.statuses.wait_for()[0].message
    with publishing("/right/joint_states/measured", JointState) as measured:
        parts = JointState(name=["turn", "more"], position=[-0.2, 5.0]), JointState(name=["slide"], position=[0.31])
        wait_until(
            lambda: any(map(measured.publish, parts)) or right.send(0.3, -0.2) and right.commands.messages,
            "a command comes",
            every_s=0.25,
        )
    bursts = iter([0.3 + 0.001 * k for k in range(n, n + 4)] for n in range(0, 400, 4))

    def came_apart() -> bool:
        """Sends four targets at once; returns whether it took long, which a pause of our own process may hide."""
        slides = next(bursts)
        right.send(7.0, -0.2, slides[0], name=["mount", "turn", "slide"])  # that of the mount is fixed
        for slide in slides[1:]:
            right.send(slide, -0.2)
        wait_until(lambda: right.commands.messages[-1].data == (slides[-1], -0.2), "the last target has passed")
        assert [each.data for each in right.commands.messages[-4:]] == [(slide, -0.2) for slide in slides]
        return right.commands.arrival_s[-1] - right.commands.arrival_s[-4] > 0.5

    wait_until(came_apart, "three periods of 0.2 s lie between the first command and the last")
    assert left.statuses.messages == []


def test_no_target_of_a_long_burst_is_dropped(left):
    """A source or a guard that got no processor time for seconds; a dropped target would make the next one a jump."""
    path = [0.15 - 0.15 * math.cos(math.pi * k / 250) for k in range(251)]
    for place in path:
        left.send(place, 0.0)
    left.commands.wait_for(len(path))
    assert [each.position[0] for each in left.commands.messages] == pytest.approx(path)
    assert not left.violations.messages


def test_robot_too_near_to_itself_receives_the_direction_away(module_ros):
    checks = {"self_collision": {"margin_m": 0.1}, "staleness": {"timeout_s": 60.0}}
    near = GuardStation(
        module_ros, "/near", robot_description=FOLDING, start_from="target", period_s=0.01, checks=checks
    )
    near.wait()
    folded = {"name": ["shoulder", "elbow"]}
    near.send(0.0, 2.6, **folded)
    near.commands.wait_for()
    near.send(0.0, 2.7, **folded)
    message = near.statuses.wait_for(2)[1].message
    near.close()
    assert message.startswith("joint_velocity: joint 'elbow': velocity is 10 rad/s")
    assert "; inside the margin of self_collision (links 'base' and 'lower': " in message
    assert message.endswith("elbow -1.00 leads away")


@pytest.fixture
def parameters(ros) -> Iterator[Any]:
    """Sets private parameters of the tests' own node."""

    def set_all(**values: Any) -> None:
        rospy.set_param("~robot_description", SLIDER)
        for name, value in values.items():
            rospy.set_param(f"~{name}", value)

    yield set_all
    rospy.delete_param(rospy.get_name())


def test_parameters_of_the_release_are_taken(parameters):
    parameters(
        start_from="target",
        period_s=0.01,
        exotica_xml_filename="any.xml",
        joint_velocity_limit="0.4 3",
        joint_position_upper_limit="0.5 2",
        joint_velocity_limit_factor=0.5,
        checker={"jointpositionlimit": {"active": False}, "linkboxlimit": {"active": True}},
        links="hand",
        box_xlim="-0.1 inf",
    )
    guard, output = guard_of_parameters()
    assert guard.joint_names == tuple(NAMES) and output.publish_as_joint_state
    guard.start()
    assert guard.decide((0.0, 0.0), CheckContext()).command
    violation = guard.decide((0.0021, 0.0), CheckContext()).violation
    assert "velocity is 0.21 m/s, limit 0.2 m/s" in str(violation)


@pytest.mark.parametrize(
    "values, words",
    [
        ({"checks": {"link_box": {"boxes": {"hnd": {}}}}}, "checks.link_box.boxes.hnd: unknown link 'hnd'"),
        ({"joint_velocity_limit": "1 2 3"}, "joint_velocity_limit: expected 2 numbers"),
        ({"polcy": "limit"}, "polcy: unknown key"),
    ],
)
def test_a_parameter_that_is_wrong_is_named(parameters, values, words):
    parameters(**values)
    with pytest.raises(ConfigError, match=words):
        guard_of_parameters()


def test_launch_files_of_the_release_get_missing_parameters_named(parameters, ros):
    """They have the robot's description from EXOTica, and no measured positions."""
    heard = Rosout(ros, own=True)
    heard.wait_to_hear(rospy.get_name())
    rospy.set_param("~exotica_xml_filename", "any.xml")
    with pytest.raises(ConfigError, match="'robot_description', got nothing; 'exotica_xml_filename', which names it"):
        guard_of_parameters()
    rospy.set_param("~robot_description", SLIDER)
    guard, _ = guard_of_parameters()
    guard.start()
    assert "set start_from to target" in str(guard.decide((0.0, 0.0), CheckContext()).violation)
    rospy.set_param("~start_from", "target")
    guard, _ = guard_of_parameters()
    guard.start()
    assert guard.decide((0.0, 0.0), CheckContext()).command
    heard.wait_for(["the robot is assumed to be at the first target"])


def test_stamps_that_go_back_are_warned_of_once_a_minute(parameters, ros):
    """In the policy `limit` the guard goes on, and a busy computer may send hundreds of them."""
    parameters(policy="limit", start_from="target")
    guard, _ = guard_of_parameters()
    guard.start()
    guard.decide((0.0, 0.0), CheckContext())
    heard = Rosout(ros, own=True)
    heard.wait_to_hear(rospy.get_name())
    status = GuardStatus(guard, "/joint_states/target")
    for _ in range(20):
        status.publish(Header(), guard.decide((0.0, 0.0), CheckContext(stamp_step_s=-0.01)).violation)
    rospy.logwarn("all have been published")
    heard.wait_for(["all have been published"])
    assert [log.msg for log in heard.logs("stamp")] == [
        "/joint_states/target: staleness: the stamp of the target is 0.01 s earlier than that of the previous target;"
        " give each target a later stamp, or none, and let only one source publish"
    ]


def test_status_can_be_a_diagnostic_as_in_the_release(ros):
    station = GuardStation(ros, "/diagnosed", start_from="target", status_as_diagnostic=True)
    station.wait()
    station.send(0.0, 0.0)
    wait_until(lambda: station.statuses.messages[-1].level == DiagnosticStatus.OK, "it is safe")
    station.send(float("nan"), 0.0)
    wait_until(lambda: station.statuses.messages[-1].level == DiagnosticStatus.ERROR, "it is not")
    unsafe = station.statuses.messages[-1]
    assert unsafe.message.startswith("input: ")
    assert {each.key: each.value for each in unsafe.values}["check"] == "input"


@pytest.mark.parametrize("policy, on_halt", [("limit", "brake"), ("limit", "nothing"), ("reject", "nothing")])
def test_targets_that_pause_halt_only_the_policy_reject(ros, policy, on_halt):
    """A busy computer pauses targets; with `limit`, the next one is followed without a call."""
    checks = {"staleness": {"timeout_s": 0.5}}
    options = {"start_from": "target", "period_s": 0.01, "limits": {"velocity": 1.0}, "on_halt": on_halt}
    guard = GuardStation(ros, f"/pausing_{policy}_{on_halt}", policy=policy, checks=checks, **options)
    guard.wait()
    for k in range(6):
        guard.send_unstamped(1e-3 * k, 0.0)
        wait_until(lambda: len(guard.commands.messages) > k or guard.violations.messages, "an answer")  # noqa: B023
    assert guard.violations.wait_for()[0].message.startswith("staleness: no target for 0.5")
    if policy == "reject":
        assert not guard.call("stop").success, "it has halted by itself"
    else:
        goal = at(guard) + 0.01
        wait_until(lambda: guard.send_unstamped(goal, 0.0) or at(guard) == pytest.approx(goal, abs=1e-3), "it follows")
    guard.close()


def at(guard: GuardStation) -> float:
    """Returns the last position that was commanded to the first joint [m]."""
    return guard.commands.messages[-1].position[0]


def test_limit_policy_drops_targets_held_too_long_and_continues(ros):
    guard = GuardStation(ros, "/held", start_from="target", period_s=0.5, policy="limit", silence_s=0.1)
    guard.wait()
    for x in (0.0, 0.0, 1e-3):
        guard.send_unstamped(x, 0.0)
    assert guard.violations.wait_for()[0].message.startswith("staleness: the target is ")
    guard.send_unstamped(0.0, 0.0)
    guard.commands.wait_for(2)
    guard.close()
