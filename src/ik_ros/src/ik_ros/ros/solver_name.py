"""Use of a solver's name in ROS: as a command line argument, and as part of node, topic and service names."""

import sys
from collections.abc import Callable

import rospy

from custom_ros_tools.plugins import trust_only
from custom_ros_tools.ros.lifecycle.run_node import run_node
from ik_ros.solvers import SOLVERS


def topics_of(kind: str, name: str) -> str:
    """Returns the prefix of topic and service names for a node of a solver.

    Args:
        kind: Kind of the node, `setup` or `solver`.
        name: Name of the solver.
    """
    return f"ik/{kind}/{name.replace(':', '/').replace('.', '/')}"


def trust_only_what_was_named() -> None:
    """Forbids imports of plug-ins other than those that the node's options have already named."""
    trust_only({"ik_ros", "rpbi"}, "nodes of ik_ros import only plug-ins that their options name at the start")


def run_for_solver(kind: str, make: Callable[[str], object]) -> None:
    """Runs a node for the solver that is named on the command line; without a name, exits with status 2.

    Args:
        kind: Kind of the node, `setup` or `solver`.
        make: Function that takes the solver's name and makes the node.
    """
    arguments = rospy.myargv(sys.argv)[1:]
    if len(arguments) != 1:
        print(f"usage: ik_{kind}_node.py SOLVER, out of {', '.join(SOLVERS)}, or module:Class", file=sys.stderr)
        sys.exit(2)
    (name,) = arguments
    run_node(
        f"ik_{kind}_{name.rpartition(':')[2]}", lambda: make(name), anonymous=True, loggers=["robot_model", "rpbi"]
    )
