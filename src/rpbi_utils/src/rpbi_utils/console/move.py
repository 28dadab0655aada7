"""The command `move`."""

from typing import Annotated

from custom_srvs.srv import SetTransform
from geometry_msgs.msg import Quaternion, Transform, Vector3
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from custom_ros_tools.console.argument import Argument, number
from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.transforms import quat_of
from ros_pybullet_interface.msg import CalculateInverseKinematicsProblem
from ros_pybullet_interface.srv import ResetEffState, ResetJointState

from .running_simulator import OBJECTS, Namespace, RunningSimulator, joint_values


def move(
    name: Annotated[str, Argument("NAME", offers=OBJECTS)],
    *goal: Annotated[str, Argument("[GOAL ...]")],
    duration_s: Annotated[float, Argument("S", "--in", number)] = 2.0,
    home: Annotated[bool, Argument("", excludes="instead")] = False,
    stop: Annotated[bool, Argument("", excludes="instead")] = False,
    ns: Namespace = None,
) -> str:
    """Moves joints or a link of a robot in a given time, or teleports an object to a pose.

    The command waits for the end of the motion and prints the remaining error. The exit code is 1 if the robot did not
    reach the goal. Ctrl-C ends the command, but the robot keeps moving.

        ./rpbi move panda panda_joint4:=-90deg panda_joint6:=1.6
        ./rpbi move panda/panda_grasptarget 0.5 0 0.3 180deg 0 0
        ./rpbi move box 0.5 0 0.3

    Usage:
        ./rpbi move ROBOT JOINT:=POSITION ... [--in S] [--ns NAMESPACE]
        ./rpbi move ROBOT/LINK X Y Z [ROLL PITCH YAW] [--in S] [--ns NAMESPACE]
        ./rpbi move ROBOT --home [--in S] [--ns NAMESPACE]
        ./rpbi move ROBOT --stop [--ns NAMESPACE]
        ./rpbi move OBJECT X Y Z [ROLL PITCH YAW] [--ns NAMESPACE]

    Args:
        JOINT:=POSITION: goal of a joint [rad or m]; 30deg is an angle in degrees
        X Y Z: goal position in the world frame [m]
        ROLL PITCH YAW: goal orientation about the world's fixed axes [rad]; 90deg is an angle in degrees; if omitted,
            a link may have any orientation, and an object gets the orientation of the world frame
        duration_s: duration of the motion [s]; default: 2
        home: moves all joints to their start positions
        stop: ends the running motion; the joints hold their present positions
        ns: namespace of the simulator; default: ROS_NAMESPACE
    """
    simulator = RunningSimulator(ns)
    body, _, link = name.partition("/")
    if stop or home:
        if goal or link:
            raise InterfaceError(f"--{'stop' if stop else 'home'} takes the name of a robot and nothing else")
        if stop:
            return str(simulator.call(simulator.require(body, "stop_motion", "a robot"), Trigger).message)
        start = simulator.require(body, "move_to_initial_joint_state", "a robot")
        return str(simulator.call(start, ResetJointState, JointState(), duration_s).message)
    if any(":=" in word for word in goal):
        service = simulator.require(body, "move_to_joint_state", "a robot")
        values = joint_values(simulator, body, goal, are_positions=True)
        state = JointState(name=[*values], position=[*values.values()])
        return str(simulator.call(service, ResetJointState, state, duration_s).message)
    if len(goal) not in (3, 6):
        expected = "JOINT:=POSITION ..., X Y Z, X Y Z ROLL PITCH YAW, --home or --stop"
        raise InterfaceError(f"expected {expected}; got {' '.join(map(str.strip, goal)) or 'nothing'}")
    numbers = [*map(number, goal)]
    quat = quat_of(numbers[3:]).tolist() if numbers[3:] else []
    if link:
        service = simulator.require(body, "move_to_eff_state", "a robot")
        problem = CalculateInverseKinematicsProblem(
            link_name=link, targetPosition=numbers[:3], targetOrientation=quat, residualThreshold=1e-5
        )
        return str(simulator.call(service, ResetEffState, problem, duration_s).message)
    pose = Transform(Vector3(*numbers[:3]), Quaternion(*(quat or (0.0, 0.0, 0.0, 1.0))))
    return str(simulator.call(simulator.require(body, "set_pose", "an object"), SetTransform, pose).message)
