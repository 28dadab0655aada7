"""The command `restore`."""

from pathlib import Path
from typing import Annotated

from cob_srvs.srv import SetString

from custom_ros_tools.console.argument import Argument

from .running_simulator import Namespace, RunningSimulator


def restore(file: Annotated[Path, Argument("FILE.world", parse=Path, files="*.world")], *, ns: Namespace = None) -> str:
    """Restores the running world to a saved state.

    The simulator simulates again from the start of the world or from the file's keyframe, which may take a while.
    Message stamps continue to increase.

    Args:
        file: file that `save` wrote, on the simulator's computer
        ns: namespace of the simulator; default: ROS_NAMESPACE
    """
    return str(RunningSimulator(ns).call("rpbi/restore", SetString, str(file.absolute())).message)
