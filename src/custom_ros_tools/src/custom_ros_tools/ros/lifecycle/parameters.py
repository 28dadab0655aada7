"""Private parameters of a node, checked."""

from typing import TypeVar

import rospy

from custom_ros_tools.schema import ConfigModel

Model = TypeVar("Model", bound=ConfigModel)


def private_config(model: type[Model]) -> Model:
    """Return what the parameter `~config` says.

    Raises:
        ConfigError: If it is wrong; it tells everything that is.
    """
    return model.parse(rospy.get_param("~config", {}), "~config")


def private_parameters(model: type[Model]) -> Model:
    """Return the private parameters that a model names; others are left alone.

    Raises:
        ConfigError: If one is wrong; it names the node.
    """
    keys = [key for key in model.model_fields if rospy.has_param(f"~{key}")]
    return model.parse({key: rospy.get_param(f"~{key}") for key in keys}, rospy.get_name())
