"""Creation of a guard from the ROS parameters of its node."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import rospy

from custom_ros_tools.errors import ConfigError, InterfaceError, Problem
from custom_ros_tools.schema.type_names import shown
from robot_model.model import RobotModel
from robot_model.urdf.files import write_description
from safe_robot import legacy
from safe_robot.config import GuardConfig, NodeConfig
from safe_robot.guard import Guard

DESCRIPTION = "robot_description"
START_FROM_TARGET = (
    "start_from is 'target': while nothing publishes joint_states/measured, the robot is assumed to be at the first"
    " target after each start; if it is elsewhere, it moves there at unlimited speed, along a path that is not checked"
)


def guard_of_parameters() -> tuple[Guard, NodeConfig]:
    """Creates a guard from the private parameters and `robot_description`; also returns the node's configuration.

    Raises:
        ConfigError: If a parameter, or the robot's description, is wrong.
    """
    given: dict[str, Any] = dict(rospy.get_param("~", {}))
    given.pop(DESCRIPTION, None)
    guard, output = guard_of(given, _description_file(given), rospy.get_name())
    if guard.config.start_from == "target":
        rospy.logwarn(START_FROM_TARGET)
    return guard, output


def guard_of(given: Mapping[str, Any], path: str, node: str) -> tuple[Guard, NodeConfig]:
    """Creates a guard from parameters; also returns the node's configuration.

    Args:
        given: The parameters of the guard and of the node.
        path: Path of the robot's URDF.
        node: Name of the node, for messages.

    Raises:
        ConfigError: If a parameter, or the robot's description, is wrong. The message names the parameter, the expected
            and the given value.
    """
    given = dict(given)
    output = NodeConfig.parse({key: given.pop(key) for key in NodeConfig.model_fields if key in given}, node)
    config = GuardConfig.parse(legacy.translated(given, list(RobotModel(path).joint_names), node), node)
    try:
        robot = RobotModel(path, config.joint_names)
    except InterfaceError as error:
        raise ConfigError([Problem(node, "joint_names", str(error))]) from None
    return Guard(config, robot, node), output


def _description_file(given: Mapping[str, Any]) -> str:
    """Returns the path of the robot's URDF; a URDF in the parameter `robot_description` is written to a file.

    Args:
        given: The private parameters, for a hint in the error message.

    Raises:
        ConfigError: If the parameter `robot_description` is missing, or is not text.
    """
    key = rospy.search_param(DESCRIPTION)
    text = None if key is None else rospy.get_param(key)
    if not isinstance(text, str):
        got = "nothing" if text is None else shown(text)
        message = f"expected the robot's URDF, or its file, as parameter '{DESCRIPTION}', got {got}"
        if "exotica_xml_filename" in given:
            message += "; 'exotica_xml_filename', which names it in the authors' release, is not read"
        raise ConfigError([Problem(rospy.get_name(), DESCRIPTION, message)])
    return write_description(text.replace("file://", "")) if "<" in text else str(Path(text))
