"""ROS parameter with a robot's URDF, and service with a robot's joints."""

import argparse
import sys
from collections.abc import Callable

import pybullet_data
import rospy
from geometry_msgs.msg import Point, Quaternion

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.parameters import kept_parameters
from robot_model.asset_files import find_file
from robot_model.urdf.for_ros import description_for_ros
from ros_pybullet_interface.msg import JointInfo
from ros_pybullet_interface.srv import RobotInfoRequest, RobotInfoResponse
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.ros.publishers.sample_topics import joint_state_message
from rpbi.ros.requests import BodyContext
from rpbi.sensors.joint_state import JointStateSensor
from rpbi.urdf.joints import Joint
from rpbi.world.loading import robots_description


def robot_info(context: BodyContext, _: RobotInfoRequest) -> RobotInfoResponse:
    """Returns a robot's joints and their limits, the names of joints with force-torque sensors, and the joint state."""
    robot: JointedBody = context.body

    def read() -> RobotInfoResponse:
        clock = context.world.clock
        state = JointStateSensor(robot, hz=1.0).read(clock.tick)
        infos = [_joint_info(robot.pb.getJointInfo(robot.body_id, joint.index), joint) for joint in robot.joints]
        return RobotInfoResponse(
            robot_name=robot.name,
            root_link_name=robot.root_link,
            bodyUniqueId=robot.body_id,
            numJoints=len(robot.joints),
            numDof=sum(not joint.is_fixed for joint in robot.joints),
            joint_info=infos,
            enabled_ft_sensors=[sensor.joint.name for sensor in robot.force_torque_sensors],
            current_joint_state=joint_state_message(state, clock.stamp_ns),
        )

    return context.ask_body(read, robot)


def _joint_info(info: tuple, joint: Joint) -> JointInfo:
    """Converts the result of PyBullet's `getJointInfo` to a message; the fields of both have the same order.

    Args:
        info: Result of `getJointInfo` for the joint.
        joint: The joint, which supplies the message fields that PyBullet does not return.
    """
    index, name, joint_type, *numbers, link, axis, position, quat, parent = info
    place = Point(*axis), Point(*position), Quaternion(*quat), parent
    kind = joint_type, joint.type_name
    return JointInfo(index, name.decode(), *kind, *numbers, link.decode(), *place, joint.is_fixed, joint.is_revolute)


def publish_description(context: BodyContext) -> Callable[[], None] | None:
    """Sets the parameter `rpbi/NAME/robot_description`, for robot_state_publisher and RViz.

    Returns:
        A function that deletes the parameter; None if the body is not a robot.
    """
    body = context.body
    if not isinstance(body, JointedBody):
        return None
    name = rospy.resolve_name(f"rpbi/{body.name}/robot_description")
    kept_parameters.set(name, description_for_ros(body.config.loadURDF.fileName))
    return lambda: kept_parameters.delete(name)


def main() -> None:
    """Prints a URDF with mesh paths that RViz finds.

    Launch files call this program, since robot_state_publisher needs the URDF before the simulator has started.
    """
    parser = argparse.ArgumentParser(description="Prints a URDF with mesh paths that RViz finds.")
    parser.add_argument("file", help="the URDF; {package}/path is resolved, and PyBullet's data is looked in")
    parser.add_argument(
        "--robots",
        nargs="+",
        metavar="NAME",
        help="FILE is the main file of a world: prints these robots of it in one URDF, with names of links and joints"
        " that begin with NAME_",
    )
    given = parser.parse_args()
    try:
        print(robots_description(given.file, given.robots) if given.robots else _description_of(given.file))
    except (InterfaceError, OSError, ValueError) as error:
        print(f"{given.file}: {error}", file=sys.stderr)
        sys.exit(1)


def _description_of(name: str) -> str:
    return description_for_ros(find_file(name, ".", (pybullet_data.getDataPath(),)))
