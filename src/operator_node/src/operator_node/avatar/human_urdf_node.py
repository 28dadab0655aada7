"""`human_urdf.py`: prints the URDF of a person."""

import argparse
import sys

import rosgraph
import rospy
from geometry_msgs.msg import PoseArray

from operator_node.mvn.frame_messages import frame_in

from .anthropometry import measured_offsets
from .human_urdf import human_urdf

PATIENCE_S = 10.0


def main() -> int:
    """Runs the command and returns its exit code."""
    parser = argparse.ArgumentParser(description="Prints a person as URDF, for the simulator and RViz.")
    parser.add_argument("--height", type=float, default=1.75, metavar="M", help="height [m], default 1.75")
    parser.add_argument("--mass", type=float, default=75.0, metavar="KG", help="mass [kg], default 75")
    parser.add_argument("--measure", metavar="TOPIC", help="measure lengths on these segments, such as mvn/segments")
    arguments = parser.parse_args(rospy.myargv(sys.argv)[1:])
    offsets = None
    try:
        if arguments.measure:
            if not rosgraph.is_master_online():
                raise ValueError(f"there is no ROS master at {rosgraph.get_master_uri()}: is roscore running?")
            rospy.init_node("human_urdf", anonymous=True)
            offsets = measured_offsets(frame_in(rospy.wait_for_message(arguments.measure, PoseArray, PATIENCE_S)))
        print(human_urdf(arguments.height, arguments.mass, offsets), end="")
    except (ValueError, rospy.ROSException) as error:
        print(f"human_urdf: {error}", file=sys.stderr)
        return 1
    return 0
