"""The command `detach`."""

from typing import Annotated

from cob_srvs.srv import SetString

from custom_ros_tools.console.argument import Argument

from .running_simulator import OBJECTS, Namespace, RunningSimulator


def detach(*names: Annotated[str, Argument("NAME ...", offers=OBJECTS)], ns: Namespace = None) -> str:
    """Removes attachments that `attach` or the world's file has made.

    Args:
        NAME: name of an attachment
        ns: namespace of the simulator; default: ROS_NAMESPACE
    """
    simulator = RunningSimulator(ns)
    return "\n".join(simulator.call("rpbi/detach", SetString, name).message for name in names)
