"""The command `remove`."""

from typing import Annotated

from cob_srvs.srv import SetString

from custom_ros_tools.console.argument import Argument
from custom_ros_tools.errors import UnknownNameError

from .running_simulator import OBJECTS, Namespace, RunningSimulator


def remove(*names: Annotated[str, Argument("NAME ...", offers=OBJECTS)], ns: Namespace = None) -> str:
    """Removes objects or cameras from the running world.

    Args:
        NAME: name of an object or a camera
        ns: namespace of the simulator; default: ROS_NAMESPACE
    """
    simulator = RunningSimulator(ns)
    objects = simulator.objects()
    for name in names:
        if name not in objects:
            raise UnknownNameError("object", name, [*objects])
    return "\n".join(simulator.call("rpbi/remove_pybullet_object", SetString, name).message for name in names)
