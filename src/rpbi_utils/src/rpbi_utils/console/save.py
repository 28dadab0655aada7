"""The command `save`."""

from pathlib import Path
from typing import Annotated

from cob_srvs.srv import SetString

from custom_ros_tools.console.argument import Argument

from .running_simulator import Namespace, RunningSimulator


def save(
    file: Annotated[Path, Argument("FILE.world", parse=Path, files="*")],
    *,
    keyframe: Annotated[bool, Argument("")] = False,
    ns: Namespace = None,
) -> str:
    """Saves the state of the running world in a file; `restore` reproduces this state exactly, bit by bit.

    Args:
        file: file on the simulator's computer, below ~state_folder of the simulator (default: your home)
        keyframe: makes a keyframe first, so that `restore` need not simulate again; the keyframe changes the
            further simulation a little
        ns: namespace of the simulator; default: ROS_NAMESPACE
    """
    service = "rpbi/save_keyframe" if keyframe else "rpbi/save"
    return str(RunningSimulator(ns).call(service, SetString, str(file.absolute())).message)
