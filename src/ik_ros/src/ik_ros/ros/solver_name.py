"""The name of a solver in ROS: the argument of its nodes, and part of their names and topics."""

import sys
from collections.abc import Callable

import rospy

from custom_ros_tools.plugins import trust_only
from custom_ros_tools.ros.lifecycle.run_node import run_node
from ik_ros.solvers import SOLVERS


def topics_of(kind: str, name: str) -> str:
    """Returns the prefix of the topics and services of a solver's node, `setup` or `solver`."""
    return f"ik/{kind}/{name.replace(':', '/').replace('.', '/')}"


def trust_only_what_was_named() -> None:
    """Restricts imports to the solver and the tasks that the node was started with."""
    trust_only({"ik_ros", "rpbi"}, "nodes of ik_ros import only plug-ins that their options name at the start")


def run_for_solver(kind: str, make: Callable[[str], object]) -> None:
    """Runs a node whose command line names the solver; without a name, it ends the program with 2.

    Args:
        kind: `setup` or `solver`.
        make: Makes the node for the solver of a name.
    """
    arguments = rospy.myargv(sys.argv)[1:]
    if len(arguments) != 1:
        print(f"usage: ik_{kind}_node.py SOLVER, out of {', '.join(SOLVERS)}, or module:Class", file=sys.stderr)
        sys.exit(2)
    (name,) = arguments
    run_node(
        f"ik_{kind}_{name.rpartition(':')[2]}", lambda: make(name), anonymous=True, loggers=["robot_model", "rpbi"]
    )
