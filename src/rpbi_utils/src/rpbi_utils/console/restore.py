"""The command `restore`."""

from pathlib import Path
from typing import Annotated

from cob_srvs.srv import SetString

from custom_ros_tools.console.argument import Argument

from .running_simulator import Namespace, RunningSimulator


def restore(file: Annotated[Path, Argument("FILE.world", parse=Path, files="*.world")], *, ns: Namespace = None) -> str:
    """Restores the running world to a saved state.

    It simulates again from the start of the world, so it takes a while if that was long ago. Stamps do not go back.

    Args:
        file: file that `save` wrote, on the simulator's computer
        ns: of the simulator, if it was started in one
    """
    return str(RunningSimulator(ns).call("rpbi/restore", SetString, str(file.absolute())).message)
