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
    """Draws numeric fields of running topics in a window, 60 times a second.

        ./rpbi live_plot /rpbi/kuka_lwr/joint_states/position[0] /rpbi/box/contacts/force/z
        ./rpbi live_plot /rpbi/kuka_lwr/joint_states/effort/lwr_arm_1_joint --seconds 5
        ./rpbi live_plot /rpbi/kuka_lwr/joint_states/position          # all joints

    Args:
        TOPIC/FIELD: a number of a message, by index or by the name of its joint, or all numbers of an array or a part;
            the topic may come later
        seconds: time that is shown [s], 0.5 to 120; 10 without it
        out: folder of saved pictures and data; the current one without it

    Space pauses, C clears, P saves a picture, D saves the data that are shown as CSV, + and - change the time.
    """
    os.execvp("rosrun", ["rosrun", "rpbi_utils", "live_plot", *fields, "--seconds", str(seconds), "--out", str(out)])
