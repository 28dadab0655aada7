"""The name of the solver on a node's command line."""

from __future__ import annotations

import sys

import rospy

from ik_ros.solvers import SOLVERS


def solver_argument(node: str) -> str:
    """Returns the name; ends the program with 2 if there is none.

    Args:
        node: The node's executable, for the message.
    """
    arguments = rospy.myargv(sys.argv)[1:]
    if len(arguments) != 1:
        print(f"usage: {node} SOLVER, out of {', '.join(SOLVERS)}, or module:Class", file=sys.stderr)
        sys.exit(2)
    return arguments[0]
