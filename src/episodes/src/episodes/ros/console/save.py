"""The command `save`."""

from pathlib import Path
from typing import Annotated

from cob_srvs.srv import SetString

from custom_ros_tools.console.argument import Argument
from rpbi_utils.ros.console.running_simulator import Namespace, RunningSimulator


def save(file: Annotated[Path, Argument("FILE.world", parse=Path, files="*")], *, ns: Namespace = None) -> str:
    """Saves the state of the running world in a file, from which `restore` makes the same world, to the last bit.

    Args:
        file: file that the simulator writes, on its computer, in your home or its ~state_folder
        ns: of the simulator, if it was started in one
    """
    return str(RunningSimulator(ns).call("rpbi/save", SetString, str(file.absolute())).message)
