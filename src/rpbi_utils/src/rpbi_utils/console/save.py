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
    """Saves the state of the running world in a file, from which `restore` makes the same world, to the last bit.

    Args:
        file: file that the simulator writes, on its computer, in your home or its ~state_folder
        keyframe: makes a keyframe first, which changes what follows a little; the file is then restored at once
        ns: of the simulator, if it was started in one
    """
    service = "rpbi/save_keyframe" if keyframe else "rpbi/save"
    return str(RunningSimulator(ns).call(service, SetString, str(file.absolute())).message)
