"""`motion_planner_node.py`: plans motions of a robot without collisions, shows them in RViz, and executes them."""

from __future__ import annotations

import sys
from typing import Any

from custom_ros_tools.ros.lifecycle.run_node import run_node

NODE = "motion_planner"
SWITCH_S = 0.0005
"""Time after which Python switches to a waiting thread: a plan must not delay joint states and poses [s]."""


def _start() -> Any:
    from .motion_services import MotionServices  # needs the extra `planning`; a missing one ends the node with one line

    return MotionServices()


def main() -> None:
    """Runs the node."""
    sys.setswitchinterval(SWITCH_S)
    run_node(NODE, _start, loggers=("rpbi_planning", "rpbi"))
