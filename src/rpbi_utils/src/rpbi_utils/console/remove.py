"""The command `remove`."""

from typing import Annotated

from cob_srvs.srv import SetString

from custom_ros_tools.console.argument import Argument
from custom_ros_tools.errors import UnknownNameError

from .running_simulator import OBJECTS, Namespace, RunningSimulator


def remove(*names: Annotated[str, Argument("NAME ...", offers=OBJECTS)], ns: Namespace = None) -> str:
    """Takes objects or cameras out of the running world.

    Args:
        ns: of the simulator, if it was started in one
    """
    simulator = RunningSimulator(ns)
    objects = simulator.objects()
    for name in names:
        if name not in objects:
            raise UnknownNameError("object", name, [*objects])
    return "\n".join(simulator.call("rpbi/remove_pybullet_object", SetString, name).message for name in names)
