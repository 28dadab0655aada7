"""The service that tells what is known of a robot."""

from __future__ import annotations

from geometry_msgs.msg import Point, Quaternion

from ros_pybullet_interface.msg import JointInfo
from ros_pybullet_interface.srv import RobotInfoRequest, RobotInfoResponse
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.ros.publishers.sample_topics import joint_state_message
from rpbi.ros.services.body_context import BodyContext
from rpbi.sensors.joint_state import JointStateSensor
from rpbi.urdf.joints import Joint


def robot_info(context: BodyContext, _: RobotInfoRequest) -> RobotInfoResponse:
    """Tells a robot's joints and where they are."""
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
