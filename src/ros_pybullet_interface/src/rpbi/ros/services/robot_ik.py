"""Inverse kinematics of robots: a service that returns solutions, and a topic that moves the robot to them."""

import math
from dataclasses import fields, replace
from typing import Any, cast

import rospy
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from custom_ros_tools.ros.lifecycle.wall_time import ThrottledWarning
from robot_model.geometry import angle_between, normalized
from ros_pybullet_interface.msg import CalculateInverseKinematicsProblem
from ros_pybullet_interface.srv import CalculateInverseKinematicsRequest
from rpbi.bodies import Body
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.control.joint_command import JointCommand
from rpbi.geometry import Pose
from rpbi.kinematics import IKProblem, PybulletSolution
from rpbi.ros.headers import to_ros_time
from rpbi.ros.requests import BodyContext

NEAR_M, NEAR_RAD = 0.01, 0.02
"""Largest position error [m] and angle error [rad] of a link that has reached its target.

They allow for an error of 0.01 rad in each joint."""
_warn = ThrottledWarning()


def moved_by_ik(body: Body) -> tuple[str, ...]:
    """Returns a tuple with the body's name if the body subscribes to `rpbi/NAME/ik`, otherwise an empty tuple."""
    return (body.name,) if isinstance(body, JointedBody) and body.config.start_ik_callback else ()


def inverse_kinematics(
    context: BodyContext, request: CalculateInverseKinematicsRequest
) -> tuple[bool, str, JointState]:
    """Returns joint positions that bring a link to a pose, without moving the robot.

    The answer has the positions of all joints that a motor can move. If the pose is out of reach, these positions bring
    the link as near as possible. Such an answer has `success=True` unless the robot is configured as `strict`.

    Raises:
        InterfaceError: If the robot has no such link or was removed.
        ValueError: If a field of the problem is invalid.
    """
    solution = solve_for_robot(context, request.problem)
    success, message = _judged(context, solution)
    state = JointState(
        header=Header(stamp=to_ros_time(context.world.clock.stamp_ns)),
        name=solution.joint_names,
        position=solution.positions,
        velocity=_velocities(request.problem, solution),
    )
    return success, message, state


def move_by_ik(context: BodyContext, problem: CalculateInverseKinematicsProblem) -> None:
    """Solves an inverse-kinematics problem, and sets the solution as the target of the joints that move the link.

    The other joints keep their targets.

    Raises:
        InterfaceError: If the robot has no such link or was removed.
        ValueError: If a field of the problem is invalid, or the robot is configured as `strict` and the pose is out of
            reach. The robot does not move then.
    """
    solution = solve_for_robot(context, problem)
    success, message = _judged(context, solution)
    if not success:
        raise ValueError(message)
    if not solution.success:
        _warn(rospy.resolve_name(f"rpbi/{context.name}/ik"), message)
    velocity = dict(zip(solution.joint_names, _velocities(problem, solution)))
    target = JointCommand(
        solution.chain, solution.chain_positions, [velocity[name] for name in solution.chain] if velocity else ()
    )
    context.world.put(f"{context.name}/target", target)


def arrival(context: BodyContext, message: CalculateInverseKinematicsProblem) -> tuple[bool, str]:
    """Compares the present pose of a problem's link with the problem's target pose, both in the world frame.

    Returns:
        Whether the errors are within the tolerances NEAR_M and NEAR_RAD, and a text with the errors.

    Raises:
        InterfaceError: If the robot was removed.
    """
    robot: JointedBody = context.body
    base, positions = context.ask_body(lambda: (robot.base_pose(), robot.joint_positions()))
    pose = base @ robot.kinematics.forward(list(positions.values()), message.link_name)
    off_m, off_rad, angle = math.dist(pose.position, message.targetPosition), 0.0, ""
    if message.targetOrientation:
        off_rad = angle_between(pose.quat_xyzw, normalized(message.targetOrientation))
        angle = f" and {off_rad:.3g} rad"
    is_near = off_m <= NEAR_M and off_rad <= NEAR_RAD
    return is_near, f"link '{message.link_name}' is {off_m * 1e3:.3g} mm{angle} from its target"


def solve_for_robot(context: BodyContext, message: CalculateInverseKinematicsProblem) -> PybulletSolution:
    """Solves an inverse-kinematics problem whose target pose is in the world frame, for the robot's present base pose.

    The search starts at the message's `currentPosition`; if that is empty, at the robot's present joint positions. Any
    thread except the simulation thread may call this function; the simulation continues meanwhile.

    Raises:
        InterfaceError: If the robot has no such link or was removed.
        ValueError: If a field of the problem is invalid.
    """
    robot: JointedBody = context.body
    problem = IKProblem(**{field.name: getattr(message, field.name) for field in fields(IKProblem)})
    if not (math.isfinite(message.dt) and message.dt >= 0.0):
        raise ValueError(f"dt: must not be negative, got {message.dt}")
    base, positions = context.ask_body(lambda: (robot.base_pose(), robot.joint_positions()), robot)
    orientation = problem.targetOrientation or Pose().quat_xyzw
    target = base.inverse() @ Pose(cast(Any, problem.targetPosition), cast(Any, orientation))
    in_base = replace(
        problem,
        targetPosition=target.position,
        targetOrientation=target.quat_xyzw if problem.targetOrientation else (),
        currentPosition=problem.currentPosition or tuple(positions.values()),
    )
    return robot.kinematics.solve(in_base)


def _judged(context: BodyContext, solution: PybulletSolution) -> tuple[bool, str]:
    """Returns whether a solution counts as a success for this robot, and a message for the service's client."""
    if solution.success or context.body.config.strict:
        return solution.success, solution.message
    return True, f"as near as possible: {solution.message}"


def _velocities(problem: CalculateInverseKinematicsProblem, solution: PybulletSolution) -> list[float]:
    """Returns constant joint velocities [rad/s or m/s] that lead from `currentPosition` to the solution in `dt`.

    Returns an empty list if the problem has no `currentPosition` or its `dt` is 0.

    Raises:
        ValueError: If `dt` is too short for finite velocities.
    """
    if not (problem.dt and problem.currentPosition):
        return []
    velocities = [(goal - here) / problem.dt for goal, here in zip(solution.positions, problem.currentPosition)]
    if not all(map(math.isfinite, velocities)):
        raise ValueError(f"dt: too short for a velocity, got {problem.dt}")
    return velocities
