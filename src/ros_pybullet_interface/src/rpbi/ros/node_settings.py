"""What the parameter server tells the simulator node."""

from __future__ import annotations

from typing import Any

import rospy

from custom_ros_tools.errors import ConfigError, Problem
from custom_ros_tools.ros.kept_parameters import kept_parameters

from ..urdf import write_description


def config_parameter() -> dict[str, Any]:
    """Returns the main configuration, `~config`.

    Raises:
        ConfigError: If there is none.
    """
    config = rospy.get_param("~config", None)
    if config is None:
        how = 'load it with <rosparam param="config" file="WORLD.yaml"/> inside the <node>'
        raise ConfigError([Problem("~config", "", f"missing: expected the main configuration; {how}")])
    return config


def robot_description_file() -> str | None:
    """Returns a file with the robot description of the parameter server, None if there is none."""
    text = _parameter_above("robot_description", None)
    return None if text is None else write_description(text)


def uses_simulated_time() -> bool:
    """Tells whether stamps are to be simulated time."""
    return bool(_parameter_above("use_sim_time", False))


def _parameter_above(name: str, default: Any) -> Any:
    """Returns a parameter of this namespace or, failing that, of the nearest one around it."""
    found = rospy.search_param(name)
    if found is None:
        return default
    kept_parameters.keep(found)
    return rospy.get_param(found)
