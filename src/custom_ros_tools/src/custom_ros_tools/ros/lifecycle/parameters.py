"""Reads and validates the private parameters of a node, and sets parameters again at a restarted ROS master."""

import contextlib
from typing import Any, TypeVar

import rospy

from custom_ros_tools.schema import ConfigModel

from .timed_master import MASTER_FAILURES, timed_master

Model = TypeVar("Model", bound=ConfigModel)


def private_config(model: type[Model]) -> Model:
    """Reads the parameter `~config`, and validates it with a model.

    Raises:
        ConfigError: If the parameter is invalid; the message lists all faults.
    """
    return model.parse(rospy.get_param("~config", {}), "~config")


def private_parameters(model: type[Model]) -> Model:
    """Reads and validates the private parameters that are fields of a model. Ignores all other parameters.

    Raises:
        ConfigError: If a parameter is invalid; the message names the node.
    """
    keys = [key for key in model.model_fields if rospy.has_param(f"~{key}")]
    return model.parse({key: rospy.get_param(f"~{key}") for key in keys}, rospy.get_name())


class KeptParameters:
    """Stores names and values of parameters, so that they can be set again at a restarted master."""

    def __init__(self) -> None:
        self._values: dict[str, Any] = {}

    def keep(self, name: str) -> None:
        """Stores the current value of a parameter, or all values in a namespace; ignores missing parameters."""
        name = rospy.resolve_name(name)
        if rospy.has_param(name):
            self._values[name] = rospy.get_param(name)

    def set(self, name: str, value: Any) -> None:
        """Stores a parameter, and sets it at the master. If the master is unreachable, `restore` sets it later."""
        name = rospy.resolve_name(name)
        self._values[name] = value
        with contextlib.suppress(*MASTER_FAILURES), timed_master() as master:
            master.setParam(rospy.get_name(), name, value)

    def delete(self, name: str) -> None:
        """Deletes a parameter in this object and at the master; ignores a missing parameter or unreachable master."""
        name = rospy.resolve_name(name)
        self._values.pop(name, None)
        with contextlib.suppress(*MASTER_FAILURES), timed_master() as master:
            master.deleteParam(rospy.get_name(), name)

    def restore(self, master: Any) -> None:
        """Sets all stored parameters that a master does not have.

        Args:
            master: Interface of the master, see `timed_master`.
        """
        caller = rospy.get_name()
        for name, value in dict(self._values).items():
            if not master.hasParam(caller, name)[2]:
                master.setParam(caller, name, value)


kept_parameters = KeptParameters()
"""The kept parameters of this process's node."""
