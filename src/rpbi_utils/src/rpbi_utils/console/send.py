"""The command `send`."""

import time
import warnings
from typing import Annotated, Any

import rospy
from cob_srvs.srv import SetString
from geometry_msgs.msg import Twist, Vector3, Wrench
from sensor_msgs.msg import JointState

from custom_ros_tools.console.argument import Argument, number
from custom_ros_tools.errors import InterfaceError
from ros_pybullet_interface.srv import ApplyWrench

from .running_simulator import OBJECTS, Namespace, RunningSimulator, joint_values

SEND_HZ = 50.0
CONNECT_S = 5.0
"""Time limit for the simulator to connect to the topic [s]. Afterwards the command fails."""
Numbers = list[float] | None
_PLURALS = {"position": "positions", "velocity": "velocities", "effort": "efforts"}


def send(
    name: Annotated[str, Argument("NAME", offers=OBJECTS)],
    *targets: Annotated[str, Argument("[JOINT:=VALUE ...]")],
    velocity: Annotated[bool, Argument("", excludes="kind")] = False,
    effort: Annotated[bool, Argument("", excludes="kind")] = False,
    drive: Annotated[Numbers, Argument("VX VY TURN", parse=number, excludes="kind")] = None,
    push: Annotated[Numbers, Argument("FX FY FZ", parse=number, excludes="kind")] = None,
    duration_s: Annotated[float, Argument("S", "--for", number)] = 1.0,
    ns: Namespace = None,
) -> str:
    """Sends targets to a robot's joints or a velocity to a mobile robot's base, or applies a force to an object.

    Position targets act at once; `move` reaches positions in a given time.

    Usage:
        ./rpbi send ROBOT JOINT:=VALUE ... [--velocity | --effort] [--for S] [--ns NAMESPACE]
        ./rpbi send ROBOT --drive VX VY TURN [--for S] [--ns NAMESPACE]
        ./rpbi send OBJECT[/LINK] --push FX FY FZ [--for S] [--ns NAMESPACE]

    Args:
        JOINT:=VALUE: position of a joint [rad or m]; 30deg is an angle in degrees
        velocity: the values are velocities [rad/s or m/s], for robots under velocity control
        effort: the values are efforts [N m or N], for robots under torque control
        drive: velocity of the base in the base's frame [m/s, m/s, rad/s]
        push: force on the link's origin [N], in the world's axes
        duration_s: duration of velocities, efforts or the force [s]; default: 1. Positions are sent once.
        ns: namespace of the simulator; default: ROS_NAMESPACE
    """
    simulator = RunningSimulator(ns)
    body, _, link = name.partition("/")
    if (drive or push) and targets:
        raise InterfaceError(f"expected --drive, --push or targets of joints, got {' '.join(targets)} as well")
    if push:
        wrench = Wrench(force=Vector3(*push))
        fields = {"object_name": name, "wrench": wrench, "frame": "world", "duration": duration_s}
        return str(simulator.call("rpbi/apply_wrench", ApplyWrench, **fields).message)
    if link:
        raise InterfaceError(f"'{name}': only --push takes a link")
    if drive:
        topic = simulator.require(body, "cmd_vel", "a robot with planar_base")
        vx, vy, turn = drive
        _publish(simulator, topic, Twist(Vector3(vx, vy, 0.0), Vector3(z=turn)), duration_s, Twist())
        return f"drove for {duration_s:g} s"
    topic = simulator.require(body, "joint_states/target", "a robot")
    _check_mode(simulator, body, "velocity" if velocity else "effort" if effort else "position")
    values = joint_values(simulator, body, targets, are_positions=not (velocity or effort))
    names = [*values]
    if velocity or effort:
        field = "velocity" if velocity else "effort"
        still = JointState(name=names, **{field: [0.0] * len(names)})
        _publish(simulator, topic, JointState(name=names, **{field: [*values.values()]}), duration_s, still)
        return f"sent for {duration_s:g} s"
    _publish(simulator, topic, JointState(name=names, position=[*values.values()]))
    return "sent"


def _check_mode(simulator: RunningSimulator, robot: str, quantity: str) -> None:
    """Raises an InterfaceError if a robot's control mode does not accept `position`, `velocity` or `effort` targets."""
    if simulator.objects().get(robot) == "visual_robot":
        mode = "POSITION_CONTROL"
    else:
        mode = simulator.call(f"rpbi/{robot}/set_control_mode", SetString, "").message
    takes = {"VELOCITY_CONTROL": "velocity", "TORQUE_CONTROL": "effort"}.get(mode, "position")
    if takes != quantity:
        right = {"velocity": "VELOCITY_CONTROL", "effort": "TORQUE_CONTROL"}.get(quantity, "POSITION_CONTROL")
        service = simulator.full_name(f"rpbi/{robot}/set_control_mode")
        switch = f"; switch it first: rosservice call {service} {right}"
        raise InterfaceError(
            f"'{robot}' is under {mode}, which takes {_PLURALS[takes]}, not {_PLURALS[quantity]}{switch}"
        )


def _publish(simulator: RunningSimulator, topic: str, message: Any, duration_s: float = 0.0, last: Any = None) -> None:
    """Publishes a message once. If `last` is given, repeats the message for `duration_s` [s], then publishes `last`.

    The duration is in wall time.
    """
    rospy.init_node("rpbi_world", anonymous=True, disable_signals=True, disable_rostime=True)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # without a queue, `publish` returns after sending the message
            publisher = rospy.Publisher(simulator.full_name(topic), type(message), queue_size=None)
        end_s = time.monotonic() + CONNECT_S
        while not publisher.get_num_connections():
            if time.monotonic() > end_s:
                raise InterfaceError(f"the simulator does not listen to {simulator.full_name(topic)}")
            time.sleep(0.01)
        publisher.publish(message)
        end_s = time.monotonic() + duration_s
        while last is not None and time.monotonic() < end_s:
            time.sleep(min(1.0 / SEND_HZ, duration_s))
            publisher.publish(message if time.monotonic() < end_s else last)
    finally:
        rospy.signal_shutdown("sent")
