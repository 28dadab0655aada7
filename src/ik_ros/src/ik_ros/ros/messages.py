"""Converts problems, joint positions, poses and trajectories to and from ROS messages."""

import rospy
from geometry_msgs.msg import Point, Quaternion, Transform, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from custom_ros_tools.joint_values import JointValues
from ik_ros.msg import IKProblem as IKProblemMessage
from ik_ros.msg import TaskGoal, TracIKProblem
from ik_ros.msg import Waypoint as WaypointMessage
from ik_ros.problem import IKProblem, JointPositions, SampledTrajectory, Waypoint
from robot_model.geometry import Pose, Vector


def problem_in(message: IKProblemMessage) -> IKProblem:
    """Converts a message to a problem. The poses stay in the frame of the message.

    Raises:
        ValueError: If a number is not finite or out of range, or lists differ in length; the message names the field.
    """
    return IKProblem(
        target=pose_in(message.target) if message.has_target else None,
        position_tolerance=_vector_in(message.position_tolerance),
        rotation_tolerance=_vector_in(message.rotation_tolerance),
        start=positions_in("start", message.start),
        previous=tuple(
            positions_in(f"previous_solutions[{i}]", one) for i, one in enumerate(message.previous_solutions)
        ),
        goals={goal.task: goal.values for goal in message.goals},
        waypoints=tuple(Waypoint(one.time_from_start.to_sec(), pose_in(one.pose)) for one in message.waypoints),
        seed=message.seed,
    )


def problem_in_trac_ik(message: TracIKProblem) -> IKProblem:
    """Converts a `TracIKProblem`, a message of the original package, to a problem.

    Raises:
        ValueError: As for `problem_in`.
    """
    return IKProblem(
        target=transform_in(message.goal),
        position_tolerance=(message.bx, message.by, message.bz),
        rotation_tolerance=(message.brx, message.bry, message.brz),
        start=positions_in("qinit", message.qinit),
    )


def problem_message(problem: IKProblem, header: Header) -> IKProblemMessage:
    """Converts a problem to a message."""
    message = IKProblemMessage(header=header, has_target=problem.target is not None, seed=problem.seed)
    if problem.target is not None:
        message.target = pose_message(problem.target)
    message.position_tolerance = Vector3(*problem.position_tolerance)
    message.rotation_tolerance = Vector3(*problem.rotation_tolerance)
    message.start = positions_message(problem.start)
    message.previous_solutions = [positions_message(one) for one in problem.previous]
    message.goals = [TaskGoal(task, list(values)) for task, values in problem.goals.items()]
    message.waypoints = [
        WaypointMessage(rospy.Duration.from_sec(one.time_s), pose_message(one.pose)) for one in problem.waypoints
    ]
    return message


def positions_in(what: str, message: JointState) -> JointPositions:
    """Converts a joint state to positions by joint name; returns an empty dict for an empty message.

    Args:
        what: Name of the field that contains the joint state, for error messages.
        message: The joint state.

    Raises:
        ValueError: If names and positions differ in number, a name is missing or repeated, or a value is not finite.
    """
    try:
        values = JointValues.of(message.name, message.position)
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from None
    if values.position and not values.names:
        raise ValueError(f"{what}: expected the names of its {len(values.position)} joints, got none")
    return dict(zip(values.names, values.position))


def positions_message(positions: JointPositions) -> JointState:
    """Converts positions by joint name to a joint state."""
    return JointState(name=list(positions), position=list(positions.values()))


def trajectory_message(joint_names: tuple[str, ...], trajectory: SampledTrajectory | None) -> JointTrajectory:
    """Converts a trajectory to a message with stamp 0, which means that the motion starts when the message arrives.

    Without a trajectory, the message is empty.
    """
    if trajectory is None:
        return JointTrajectory()
    points = zip(trajectory.times_s, trajectory.positions, trajectory.velocities)
    return JointTrajectory(
        joint_names=list(joint_names),
        points=[
            JointTrajectoryPoint(
                positions=list(positions), velocities=list(velocities), time_from_start=rospy.Duration.from_sec(time_s)
            )
            for time_s, positions, velocities in points
        ],
    )


def pose_in(message: PoseMessage) -> Pose:
    """Converts a pose message to a pose, without checking the numbers."""
    p, q = message.position, message.orientation
    return Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def transform_in(message: Transform) -> Pose:
    """Converts a transform message to a pose, without checking the numbers."""
    p, q = message.translation, message.rotation
    return Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def pose_message(pose: Pose) -> PoseMessage:
    """Converts a pose to a message."""
    return PoseMessage(Point(*pose.position), Quaternion(*pose.quat_xyzw))


def _vector_in(message: Vector3) -> Vector:
    return message.x, message.y, message.z
