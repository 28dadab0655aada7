"""The service that tells what is known of a robot."""

from __future__ import annotations

import rospy
from geometry_msgs.msg import Point, Quaternion

from custom_ros_tools.errors import UnknownNameError
from ros_pybullet_interface.msg import JointInfo
from ros_pybullet_interface.srv import RobotInfo, RobotInfoRequest, RobotInfoResponse

from ..bodies.robot import Robot
from ..joint_model import Joint
from ..sensors.joint_state import JointStateSensor
from ..world import World
from .outlets import joint_state_message
from .requests import Requests


class RobotInfoService:
    """Serves `rpbi/NAME/robot_info`.

    Args:
        robot: The robot.
        world: The world it is in.
        ask: Reaches the simulation thread.
    """

    def __init__(self, robot: Robot, world: World, ask: Requests) -> None:
        self._robot, self._world, self._ask = robot, world, ask
        self._sensor = JointStateSensor(robot, hz=1.0)
        self._service = rospy.Service(f"rpbi/{robot.name}/robot_info", RobotInfo, self._answer)

    def close(self) -> None:
        """Ends the service."""
        self._service.shutdown()

    def _answer(self, _: RobotInfoRequest) -> RobotInfoResponse:
        return self._ask.or_service_error(self._read)

    def _read(self) -> RobotInfoResponse:
        robot, clock = self._robot, self._world.clock
        if self._world.bodies.get(robot.name) is not robot:  # it went while the request was on its way
            raise UnknownNameError("object", robot.name, list(self._world.bodies))
        infos = [_joint_info(robot.pb.getJointInfo(robot.body_id, joint.index), joint) for joint in robot.joints]
        return RobotInfoResponse(
            robot_name=robot.name,
            root_link_name=robot.root_link,
            bodyUniqueId=robot.body_id,
            numJoints=len(robot.joints),
            numDof=sum(not joint.is_fixed for joint in robot.joints),
            joint_info=infos,
            current_joint_state=joint_state_message(self._sensor.read(clock.tick), clock.stamp_ns),
        )


def _joint_info(info: tuple, joint: Joint) -> JointInfo:
    """Turns what PyBullet's `getJointInfo` returns into a message."""
    return JointInfo(
        jointIndex=info[0],
        jointName=info[1].decode(),
        jointType=info[2],
        jointTypeStr=joint.type_name,
        qIndex=info[3],
        uIndex=info[4],
        flags=info[5],
        jointDamping=info[6],
        jointFriction=info[7],
        jointLowerLimit=info[8],
        jointUpperLimit=info[9],
        jointMaxForce=info[10],
        jointMaxVelocity=info[11],
        linkName=info[12].decode(),
        jointAxis=Point(*info[13]),
        parentFramePos=Point(*info[14]),
        parentFrameOrn=Quaternion(*info[15]),
        parentIndex=info[16],
        is_fixed=joint.is_fixed,
        is_revolute=joint.is_revolute,
    )
