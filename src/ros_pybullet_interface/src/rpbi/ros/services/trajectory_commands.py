"""The command topic and the state service of a robot's trajectory follower, and conversions from messages."""

from collections.abc import Sequence
from typing import Any

from trajectory_msgs.msg import JointTrajectory

from rpbi.bodies import Body
from rpbi.bodies.robots.robot import Robot
from rpbi.control.trajectories.request import GoalTolerances, JointTolerance, TrajectoryPoint, TrajectoryRequest
from rpbi.control.trajectories.trajectory import DesiredState
from rpbi.engine.clock import NS_PER_S
from rpbi.ros.requests import BodyContext
from rpbi.world.actions import RecordedTrajectory


def followers(body: Body) -> Sequence[str]:
    """Returns a tuple with the body's name if the body has a trajectory follower, otherwise an empty tuple."""
    return (body.name,) if isinstance(body, Robot) and body.follower is not None else ()


def trajectory_request(message: JointTrajectory) -> TrajectoryRequest:
    """Converts a message to a trajectory request; efforts are ignored."""
    points = tuple(
        TrajectoryPoint(
            point.time_from_start.to_sec(), tuple(point.positions), tuple(point.velocities), tuple(point.accelerations)
        )
        for point in message.points
    )
    return TrajectoryRequest(tuple(message.joint_names), points, message.header.stamp.to_nsec())


def goal_tolerances(goal: Any) -> GoalTolerances:
    """Returns the tolerances of a control_msgs/FollowJointTrajectoryGoal; acceleration tolerances are ignored."""
    return GoalTolerances(
        _tolerances(goal.path_tolerance), _tolerances(goal.goal_tolerance), goal.goal_time_tolerance.to_sec()
    )


def follow_command(context: BodyContext, message: JointTrajectory) -> None:
    """Makes the robot follow a trajectory without tolerances; a running goal of the action is cancelled."""
    follower, clock = context.body.follower, context.world.clock
    request = trajectory_request(message)
    checked = follower.check(request)

    def follow() -> None:
        record = RecordedTrajectory.of(request, None, clock)
        context.world.act(context.name, "follow", record, lambda body: body.follower.follow(checked, clock))

    context.ask_body(follow)


def query_state(context: BodyContext, request: Any) -> Any:
    """Returns the trajectory follower's desired joint positions, velocities and accelerations at the requested time."""
    follower, clock = context.body.follower, context.world.clock
    stamp_ns = request.time.to_nsec()

    def desired() -> DesiredState:
        return follower.desired(clock.time_s + (stamp_ns - clock.stamp_ns) / NS_PER_S)

    state = context.ask_body(desired)
    return follower.joint_names, *state


def _tolerances(messages: Sequence[Any]) -> dict[str, JointTolerance]:
    return {message.name: JointTolerance(message.position, message.velocity) for message in messages}
