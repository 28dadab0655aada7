"""The command `live_plot`."""

import os
from pathlib import Path
from typing import Annotated

from custom_ros_tools.console.argument import Argument, number


def live_plot(
    *fields: Annotated[str, Argument("TOPIC/FIELD ...")],
    seconds: Annotated[float, Argument("S", parse=number)] = 10.0,
    out: Annotated[Path, Argument("FOLDER", parse=Path, files="*")] = Path("."),
) -> None:
    """Plots numeric fields of topics in a window that is redrawn 60 times a second.

        ./rpbi live_plot /rpbi/kuka_lwr/joint_states/position[0] /rpbi/box/contacts/force/z
        ./rpbi live_plot /rpbi/kuka_lwr/joint_states/effort/lwr_arm_1_joint --seconds 5
        ./rpbi live_plot /rpbi/kuka_lwr/joint_states/position          # all joints

    Args:
        TOPIC/FIELD: a numeric field, or an array or part of the message, all of whose numbers are plotted; an array
            element is selected by its index or joint name. The topic need not exist yet.
        seconds: length of the visible time span [s], 0.5 to 120; default: 10
        out: folder for saved pictures and data; default: the current folder

    Keys: Space pauses, C clears, P saves a picture, D saves the visible data as CSV, + and - change the time span.
    """
    os.execvp("rosrun", ["rosrun", "rpbi_utils", "live_plot", *fields, "--seconds", str(seconds), "--out", str(out)])
