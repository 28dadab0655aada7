"""The plain topic and service of a follower of trajectories."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from trajectory_msgs.msg import JointTrajectory

from rpbi.bodies import Body
from rpbi.bodies.robots.robot import Robot
from rpbi.control.trajectories.trajectory import State
from rpbi.engine.actions import RecordedTrajectory
from rpbi.engine.clock import NS_PER_S
from rpbi.ros.services.body_context import BodyContext

from .trajectory_messages import CONTROLLER, FollowJointTrajectoryAction, QueryTrajectoryState, trajectory_request


def of_followers(suffix: str) -> Callable[[Body], Sequence[str]]:
    """Returns the suffixes of something that every robot with a follower of trajectories has once."""
    return lambda body: (f"{CONTROLLER}/{suffix}",) if isinstance(body, Robot) and body.follower is not None else ()


def action_suffixes(body: Body) -> Sequence[str]:
    """Returns the suffix of the action; there is none without control_msgs."""
    return of_followers("follow_joint_trajectory")(body) if FollowJointTrajectoryAction is not None else ()


def query_suffixes(body: Body) -> Sequence[str]:
    """Returns the suffix of the service that tells where joints will be; there is none without control_msgs."""
    return of_followers("query_state")(body) if QueryTrajectoryState is not None else ()


def follow_command(context: BodyContext, message: JointTrajectory) -> None:
    """Follows a trajectory without looking at how well; a goal of the action is cancelled."""
    follower, clock = context.body.follower, context.world.clock
    request = trajectory_request(message)
    checked = follower.check(request)

    def follow() -> None:
        record = RecordedTrajectory.of(request, None, clock)
        context.world.act(context.name, "follow", record, lambda body: body.follower.follow(checked, clock))

    context.ask_body(follow)


def query_state(context: BodyContext, request: Any) -> Any:
    """Tells where the joints are to be at a time, as far as it is known now."""
    follower, clock = context.body.follower, context.world.clock
    stamp_ns = request.time.to_nsec()

    def desired() -> State:
        return follower.desired(clock.time_s + (stamp_ns - clock.stamp_ns) / NS_PER_S)

    state = context.ask_body(desired)
    response = QueryTrajectoryState._response_class()
    response.name = follower.joint_names
    response.position, response.velocity, response.acceleration = state
    return response
