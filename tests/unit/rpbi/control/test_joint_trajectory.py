"""Trajectories are checked against the robot, and spliced onto what its joints do already."""

from __future__ import annotations

import math

import pybullet
import pytest

from custom_ros_tools.errors import ConfigError
from rpbi.control.trajectories.config import JointTrajectoryControllerConfig, trajectory_problems
from rpbi.control.trajectories.joint_trajectory import validate_trajectory
from rpbi.control.trajectories.motion import stopping
from rpbi.control.trajectories.request import (
    ErrorCode,
    GoalTolerances,
    JointTolerance,
    TrajectoryRefusedError,
    TrajectoryRequest,
    resolved_tolerances,
)
from rpbi.control.trajectories.request import TrajectoryPoint as Point
from rpbi.control.trajectories.trajectory import Knot, Trajectory
from rpbi.urdf.joints import Joint

INF = math.inf


def joint(index: int, name: str, lower: float = -2.0, upper: float = 2.0, speed: float = 3.0) -> Joint:
    return Joint(index, name, pybullet.JOINT_REVOLUTE, f"{name}_link", lower, upper, 100.0, speed)


JOINTS = {each.name: each for each in (joint(0, "a"), joint(3, "b"), joint(4, "wheel", -INF, INF, INF))}
NAMES = tuple(JOINTS)
STILL = (0.0, 0.0, 0.0)


def request(*points: Point, names: tuple[str, ...] = NAMES) -> TrajectoryRequest:
    return TrajectoryRequest(names, points)


def standing(position: float, time_s: float = 0.0) -> Trajectory:
    return Trajectory.through([Knot(time_s, (position,))])


def test_columns_go_to_the_joints_that_are_named():
    joint_trajectories = validate_trajectory(
        request(Point(1.0, (0.1, 0.2, 0.3)), names=("wheel", "a", "b")), JOINTS, False
    )
    assert {each.joint.name: each.trajectory.goal[0] for each in joint_trajectories} == {
        "wheel": 0.1,
        "a": 0.2,
        "b": 0.3,
    }


@pytest.mark.parametrize(
    "asked, code, message",
    [
        (request(Point(1.0, STILL), names=("a", "b", "c")), -2, "unknown joint 'c'"),
        (request(Point(1.0, STILL), names=("a", "b", "a")), -2, "joint 'a' is named more than once"),
        (request(Point(1.0, (0.0, 0.0)), names=("a", "b")), -2, "missing: wheel"),
        (request(Point(1.0, (), STILL)), -1, "point 0: expected positions of 3 joints, got 0"),
        (request(Point(1.0, STILL, (0.0,))), -1, "point 0: expected velocities of 3 joints, got 1"),
        (request(Point(1.0, STILL, STILL, (0.0,) * 4)), -1, "point 0: expected accelerations of 3 joints, got 4"),
        (request(Point(1.0, STILL, (), STILL)), -1, "point 0: accelerations need velocities"),
        (request(Point(1.0, STILL), Point(1.0, STILL)), -1, "point 1: times must increase strictly"),
        (request(Point(1.0, (0.0, math.nan, 0.0))), -1, "point 0: positions must be finite, got nan for joint 'b'"),
        (request(Point(1.0, STILL, (INF, 0.0, 0.0))), -1, "velocities must be finite, got inf for joint 'a'"),
        (request(Point(1.0, STILL), Point(2.0, (0.0, -2.1, 0.0))), -1, "point 1: joint 'b' must be within -2 to"),
        (request(Point(1.0, STILL, (0.0, 3.1, 0.0))), -1, "joint 'b' would need 3.1 rad/s at point 0"),
        (
            request(Point(1.0, STILL), Point(1.5, (1.6, 0.0, 0.0))),
            -1,
            "joint 'a' would need 3.2 rad/s between points 0 and 1; its limit is 3",
        ),
        (
            request(Point(1.0, STILL, STILL), Point(1.5, (1.5, 0.0, 0.0), STILL)),
            -1,
            "joint 'a' would need 4.5 rad/s between points 0 and 1",
        ),
        (
            request(Point(1.0, (1.9, 0.0, 0.0), (2.0, 0.0, 0.0)), Point(2.0, (1.9, 0.0, 0.0), (-2.0, 0.0, 0.0))),
            -1,
            "joint 'a' must be within -2 to 2 rad, got 2.4, where the curve swings between points 0 and 1",
        ),
    ],
)
def test_invalid_trajectories_are_refused_with_their_error_code(asked, code, message):
    with pytest.raises(TrajectoryRefusedError) as refused:
        validate_trajectory(asked, JOINTS, False)
    assert refused.value.code == code
    assert message in str(refused.value)


def test_part_of_the_joints_will_do_where_that_is_allowed():
    joint_trajectories = validate_trajectory(request(Point(1.0, (0.5,)), names=("b",)), JOINTS, True)
    assert [each.joint.name for each in joint_trajectories] == ["b"]


def test_planned_motion_at_the_speed_limit_is_accepted():
    """A trapezoidal velocity of 10 rad/s^2 up to the limit, sampled each 0.1 s as planners do, from any moment on."""
    for phase in range(20):
        points = []
        for number in range(12):
            t = number * 0.1 + phase * 0.005
            ramp = min(t, 0.3)
            position = -1.5 + 5.0 * ramp**2 + 3.0 * (t - ramp)
            velocity, acceleration = 10.0 * ramp, 10.0 * (t < 0.3)
            points.append(Point(number * 0.1 + 0.1, (position,), (velocity,), (acceleration,)))
        validate_trajectory(request(*points[:10], names=("a",)), {"a": JOINTS["a"]}, False)


def joint_trajectory_of(*points: Point, name: str = "a"):
    return validate_trajectory(request(*points, names=(name,)), {name: JOINTS[name]}, False)[0]


def test_spliced_course_skips_past_points_and_continues_to_the_next():
    planned = joint_trajectory_of(Point(0.5, (1.0,)), Point(1.5, (0.5,)), Point(2.5, (-0.5,)))
    spliced = planned.spliced_onto(standing(0.0), start_s=9.0, from_s=10.0)
    assert [spliced.sample(t).position[0] for t in (9.0, 10.0, 10.25, 10.5, 11.0, 11.5)] == pytest.approx(
        [0.0, 0.0, 0.25, 0.5, 0.0, -0.5]
    )


def test_spliced_course_begins_with_the_current_motion():
    current = Trajectory.through([Knot(0.0, (0.0,), (0.0,)), Knot(2.0, (1.0,), (0.0,))])
    planned = joint_trajectory_of(Point(1.0, (-0.5,), (0.0,)))
    spliced = planned.spliced_onto(current, start_s=1.0, from_s=1.0)
    before, after = spliced.sample(1.0 - 1e-9), spliced.sample(1.0 + 1e-9)
    assert after.position == pytest.approx(before.position, abs=1e-6)
    assert after.velocity == pytest.approx(before.velocity, abs=1e-6)
    assert before.velocity[0] == pytest.approx(0.75)
    assert spliced.goal == (-0.5,)


@pytest.mark.parametrize(
    "now, asked, goes_to",
    [(0.0, 1.5 * math.pi, -0.5 * math.pi), (6.0 * math.pi, 0.5, 6.0 * math.pi + 0.5), (0.2, 0.3, 0.3)],
)
def test_joint_without_limits_turns_the_shorter_direction_first(now, asked, goes_to):
    planned = joint_trajectory_of(Point(1.0, (asked,)), Point(2.0, (asked + 7.0,)), name="wheel")
    spliced = planned.spliced_onto(standing(now), 0.0, 0.0)
    assert spliced.sample(1.0).position[0] == pytest.approx(goes_to)
    assert spliced.goal[0] == pytest.approx(goes_to + 7.0)


def test_first_point_that_cannot_be_reached_in_time_is_refused():
    with pytest.raises(TrajectoryRefusedError, match="joint 'a' would need 15 rad/s on the way to point 0"):
        joint_trajectory_of(Point(0.1, (1.5,))).spliced_onto(standing(0.0), 0.0, 0.0)


def test_joint_that_was_pushed_beyond_its_limit_may_come_back():
    spliced = joint_trajectory_of(Point(1.0, (1.0,))).spliced_onto(standing(2.3), 0.0, 0.0)
    assert spliced.goal == (1.0,)


def test_stop_decelerates_at_a_constant_rate_within_limits():
    trajectory = stopping(JOINTS["a"], (0.5, 1.0), 3.0, 0.4)
    assert trajectory.goal[0] == pytest.approx(0.7)
    assert {round(trajectory.sample(t).acceleration[0], 9) for t in (3.0, 3.1, 3.3)} == {-2.5}
    assert stopping(JOINTS["a"], (1.9, 1.0), 3.0, 0.4).goal == (2.0,)
    assert stopping(JOINTS["a"], (0.5, 1.0), 3.0, 0.0).sample(3.0).position == (0.5,)


def constraints(**keys):
    return JointTrajectoryControllerConfig.parse({"constraints": keys}, "arm.yaml").constraints


def test_tolerances_of_a_goal_go_before_those_of_the_configuration():
    configured = constraints(goal_time=0.5, stopped_velocity_tolerance=0.02, a={"trajectory": 0.1, "goal": 0.05})
    resolved = resolved_tolerances(GoalTolerances(), configured, JOINTS)
    assert resolved.path[0] == (0.1, INF) and resolved.goal[0] == (0.05, 0.02) and resolved.goal_time_s == 0.5
    assert resolved.path[3] == (INF, INF) and resolved.goal[3] == (INF, 0.02)
    given = GoalTolerances({"a": JointTolerance(0.3, 1.0)}, {"a": JointTolerance(-1.0, -1.0)}, -1.0)
    resolved = resolved_tolerances(given, configured, JOINTS)
    assert resolved.path[0] == (0.3, 1.0) and resolved.goal[0] == (INF, INF) and resolved.goal_time_s == INF


def test_settings_of_zero_are_off_but_the_goal_time():
    resolved = resolved_tolerances(GoalTolerances(), constraints(stopped_velocity_tolerance=0.0), JOINTS)
    assert resolved.goal[0] == (INF, INF) and resolved.goal_time_s == 0.0


@pytest.mark.parametrize(
    "tolerances, code",
    [
        (GoalTolerances(path={"nobody": JointTolerance()}), ErrorCode.INVALID_JOINTS),
        (GoalTolerances(goal={"a": JointTolerance(math.nan)}), ErrorCode.INVALID_GOAL),
    ],
)
def test_bad_tolerances_are_refused(tolerances, code):
    with pytest.raises(TrajectoryRefusedError) as refused:
        resolved_tolerances(tolerances, constraints(), JOINTS)
    assert refused.value.code == code


@pytest.mark.parametrize(
    "keys, key, message",
    [
        ({"state_publish_rate": 0}, "state_publish_rate", "must be > 0"),
        ({"constraints": {"goal_tme": 1.0}}, "constraints.goal_tme", "did you mean 'goal_time'"),
        ({"constraints": {"a": {"trajectory": -1}}}, "constraints.a.trajectory", "must be >= 0"),
        ({"joints": []}, "joints", ""),
        ({"stop_trajectory_duration": -0.1}, "stop_trajectory_duration", "must be >= 0"),
    ],
)
def test_bad_configuration_is_named(keys, key, message):
    with pytest.raises(ConfigError) as found:
        JointTrajectoryControllerConfig.parse(keys, "arm.yaml")
    (problem,) = found.value.problems
    assert problem.key == key and message in problem.message


def test_joints_that_the_robot_lacks_are_named_with_their_keys():
    keys = {"joints": ["a", "elbow", "a"], "constraints": {"whel": {"goal": 0.1}}}
    config = JointTrajectoryControllerConfig.parse(keys, "arm.yaml")
    problems = {problem.key: problem.message for problem in trajectory_problems("arm", config, NAMES)}
    assert list(problems) == [
        "joint_trajectory_controller.joints[1]",
        "joint_trajectory_controller.joints[2]",
        "joint_trajectory_controller.constraints.whel",
    ]
    assert "did you mean 'wheel'" in problems["joint_trajectory_controller.constraints.whel"]
