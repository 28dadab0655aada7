"""Parameters of a node: validated private ones, and parameters that are set again at a restarted ROS master."""

import contextlib
from typing import Any, TypeVar

import rospy

from custom_ros_tools.schema import ConfigModel

from .timed_master import MASTER_FAILURES, timed_master

Model = TypeVar("Model", bound=ConfigModel)


def private_config(model: type[Model]) -> Model:
    """Returns the parameter `~config`.

    Raises:
        ConfigError: If it is wrong; lists every fault.
    """
    return model.parse(rospy.get_param("~config", {}), "~config")


def private_parameters(model: type[Model]) -> Model:
    """Returns the private parameters that a model names; others are ignored.

    Raises:
        ConfigError: If one is wrong; names the node.
    """
    keys = [key for key in model.model_fields if rospy.has_param(f"~{key}")]
    return model.parse({key: rospy.get_param(f"~{key}") for key in keys}, rospy.get_name())


class KeptParameters:
    """Stores parameters and their values, to set them again at a restarted master."""

    def __init__(self) -> None:
        self._values: dict[str, Any] = {}

    def keep(self, name: str) -> None:
        """Stores the present value of a parameter, or of all in a namespace, if there is one."""
        name = rospy.resolve_name(name)
        if rospy.has_param(name):
            self._values[name] = rospy.get_param(name)

    def set(self, name: str, value: Any) -> None:
        """Sets a parameter and stores it; without a master, it is set when one is back."""
        name = rospy.resolve_name(name)
        self._values[name] = value
        with contextlib.suppress(*MASTER_FAILURES), timed_master() as master:
            master.setParam(rospy.get_name(), name, value)

    def delete(self, name: str) -> None:
        """Deletes a parameter from the master and the store; neither it nor the master need exist."""
        name = rospy.resolve_name(name)
        self._values.pop(name, None)
        with contextlib.suppress(*MASTER_FAILURES), timed_master() as master:
            master.deleteParam(rospy.get_name(), name)

    def restore(self, master: Any) -> None:
        """Sets those that a master (see `timed_master`) does not have; existing ones stay unchanged."""
        caller = rospy.get_name()
        for name, value in dict(self._values).items():
            if not master.hasParam(caller, name)[2]:
                master.setParam(caller, name, value)


kept_parameters = KeptParameters()
"""Parameters of this process: a process is one node."""
