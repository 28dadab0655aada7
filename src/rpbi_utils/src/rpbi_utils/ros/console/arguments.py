"""Arguments that several commands of the running world have."""

from collections.abc import Sequence
from typing import Annotated

from custom_ros_tools.console.argument import Argument, number
from custom_ros_tools.errors import InterfaceError, UnknownNameError
from ros_pybullet_interface.srv import RobotInfo

from .running_simulator import RunningSimulator

OBJECTS = "objects"
"""Offer of completion: what is in the running world."""
Namespace = Annotated[str | None, Argument("NAMESPACE")]


def joint_values(simulator: RunningSimulator, robot: str, words: Sequence[str]) -> dict[str, float]:
    """Returns values by joint, from words like `JOINT:=VALUE`.

    Raises:
        InterfaceError: If a word is no such value, or there is none.
        UnknownNameError: If the robot lacks a joint.
    """
    known = simulator.call(simulator.require(robot, "robot_info", "a robot"), RobotInfo).current_joint_state.name
    values = {}
    for word in words:
        joint, is_value, value = word.partition(":=")
        if not is_value:
            raise InterfaceError(f"expected JOINT:=VALUE, got {word.strip()}")
        if joint not in known:
            raise UnknownNameError("joint", joint, known)
        values[joint] = number(value)
    if not values:
        raise InterfaceError(f"expected JOINT:=VALUE ...; the joints of '{robot}' are {', '.join(known)}")
    return values
