"""The command `gravity`."""

from typing import Annotated

from geometry_msgs.msg import Vector3

from custom_ros_tools.console.argument import Argument, number
from ros_pybullet_interface.srv import SetGravity

from .running_simulator import Namespace, RunningSimulator


def gravity(
    x: Annotated[float, Argument("X", parse=number)],
    y: Annotated[float, Argument("Y", parse=number)],
    z: Annotated[float, Argument("Z", parse=number)],
    *,
    ns: Namespace = None,
) -> str:
    """Changes gravity until the next reset.

    Args:
        X Y Z: acceleration in the world frame [m/s^2]
        ns: namespace of the simulator; default: ROS_NAMESPACE
    """
    return str(RunningSimulator(ns).call("rpbi/set_gravity", SetGravity, Vector3(x, y, z)).message)
