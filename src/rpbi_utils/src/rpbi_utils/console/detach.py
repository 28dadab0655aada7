"""The command `detach`."""

from typing import Annotated

from cob_srvs.srv import SetString

from custom_ros_tools.console.argument import Argument

from .running_simulator import OBJECTS, Namespace, RunningSimulator


def detach(*names: Annotated[str, Argument("NAME ...", offers=OBJECTS)], ns: Namespace = None) -> str:
    """Releases what was attached.

    Args:
        ns: of the simulator, if it was started in one
    """
    simulator = RunningSimulator(ns)
    return "\n".join(simulator.call("rpbi/detach", SetString, name).message for name in names)
