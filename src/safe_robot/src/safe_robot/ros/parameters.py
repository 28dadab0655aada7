"""What the guard's node is told by parameters."""

from pathlib import Path
from typing import Any

import rospy

from custom_ros_tools.errors import ConfigError, InterfaceError, Problem
from rpbi.urdf.files import write_description
from safe_robot import legacy
from safe_robot.config import GuardConfig, NodeConfig
from safe_robot.guard import Guard
from safe_robot.robot import GuardedRobot

DESCRIPTION = "robot_description"


def guard_of_parameters() -> tuple[Guard, NodeConfig]:
    """Returns the guard that private parameters and `robot_description` tell of, and what its node does beside.

    Raises:
        ConfigError: If a parameter, or the robot, is wrong.
    """
    node = rospy.get_name()
    given: dict[str, Any] = dict(rospy.get_param("~", {}))
    given.pop(DESCRIPTION, None)
    output = NodeConfig.parse({key: given.pop(key) for key in NodeConfig.model_fields if key in given}, node)
    path = _description_file()
    config = GuardConfig.parse(legacy.translated(given, list(GuardedRobot(path).joint_names), node), node)
    try:
        robot = GuardedRobot(path, config.joint_names)
    except InterfaceError as error:
        raise ConfigError([Problem(node, "joint_names", str(error))]) from None
    return Guard(config, robot, node), output


def _description_file() -> str:
    """Returns a file of the robot's description.

    Raises:
        ConfigError: If there is none.
    """
    key = rospy.search_param(DESCRIPTION)
    text = None if key is None else rospy.get_param(key)
    if not isinstance(text, str):
        message = f"expected the robot's URDF in the parameter '{DESCRIPTION}', got nothing"
        raise ConfigError([Problem(rospy.get_name(), DESCRIPTION, message)])
    return write_description(text.replace("file://", "")) if "<" in text else str(Path(text))
