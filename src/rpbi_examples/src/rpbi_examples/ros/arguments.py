"""What example nodes are told."""

from __future__ import annotations

import sys

import rospy

from custom_ros_tools.errors import InterfaceError


def robot_name() -> str:
    """Returns the robot that `~robot_name` or the first argument names.

    Raises:
        InterfaceError: If neither is given.
    """
    arguments = rospy.myargv(sys.argv)[1:]
    name = rospy.get_param("~robot_name", arguments[0] if arguments else None)
    if name is None:
        raise InterfaceError("which robot? Give its name as ~robot_name or as first argument")
    return str(name)
