"""`run_interpolation.py`: moves an arm's tip through three coloured balls, reports the tip's distances from the balls,
and draws the motion.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import Path as PathMessage
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.files import atomic_file
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.tf_interface import TfInterface
from custom_ros_tools.ros.transform_messages import as_pose, position_in
from custom_ros_tools.transforms import Array
from rpbi_examples.waypoint_plot import draw_motion

BASE, TIP, TARGET = "rpbi/kuka_lwr/lwr_arm_0_link", "rpbi/kuka_lwr/end_effector_ball", "interpol_target"
HZ = 50.0
DRAWN = 5
"""Number of samples of the target between two markers in RViz."""
AFTER_S = 1.0
"""Time for which the measurement continues after the last ball [s]."""
TF_PATIENCE_S = 60.0


class Visit(NamedTuple):
    """A ball that the tip visits.

    Attributes:
        colour: Colour of the ball.
        time_s: Time of the visit since the start of the motion [s].
        position: Position of the ball in the frame of the arm's base [m].
    """

    colour: str
    time_s: float
    position: tuple[float, float, float]


VISITS = (
    Visit("green", 4.0, (-0.4, 0.0, 0.1)),
    Visit("blue", 9.0, (-0.5, 0.2, 0.3)),
    Visit("red", 14.0, (-0.15, 0.4, 0.2)),
)


class RunInterpolation:
    """Publishes waypoints from the tip's present pose through all balls, and measures the motion of target and tip."""

    def __init__(self) -> None:
        self._tf = TfInterface()
        topic = rospy.get_param("~topic_name_4_waypoints", "ros_pybullet_interface/waypt_traj")
        self._waypoints = rospy.Publisher(topic, Float64MultiArray, queue_size=1, latch=True)
        self._path = rospy.Publisher("interpolation/path", PathMessage, queue_size=1, latch=True)
        self._drawn = PathMessage()
        self._drawn.header.frame_id = BASE
        self._rows: list[tuple[float, Array, Array]] = []
        """Time since the start [s], and the positions of target and tip [m]."""

    def run(self) -> None:
        """Publishes the waypoints, measures the motion until `AFTER_S` after the last ball, and writes the picture.

        Raises:
            InterfaceError: If TF does not have the tip within `TF_PATIENCE_S`, or the picture cannot be written.
        """
        start = self._tf.wait_for_tf(BASE, TIP, timeout=TF_PATIENCE_S)
        if start[0] is None:
            raise InterfaceError(f"no TF from '{BASE}' to '{TIP}' for {TF_PATIENCE_S:g} s: is the simulator running?")
        times_s = [0.0, *(visit.time_s for visit in VISITS)]
        positions = np.array([start[0], *(visit.position for visit in VISITS)]).T
        quats = np.tile(np.reshape(start[1], (4, 1)), len(times_s))
        self._waypoints.publish(as_message(np.vstack([times_s, positions, quats])))
        rospy.loginfo("the tip goes to %s", ", ".join(f"{each.colour} at {each.time_s:g} s" for each in VISITS))
        start_s, pending, rate = None, list(VISITS), rospy.Rate(HZ)
        while not rospy.is_shutdown():
            rate.sleep()
            target, tip = (self._tf.get_tf_msg(BASE, frame) for frame in (TARGET, TIP))
            if target is None or tip is None:
                continue
            start_s = target.header.stamp.to_sec() if start_s is None else start_s
            now_s = tip.header.stamp.to_sec() - start_s
            if now_s > VISITS[-1].time_s + AFTER_S:
                break
            place = position_in(tip.transform)
            self._rows.append((now_s, position_in(target.transform), place))
            if len(self._rows) % DRAWN == 1:
                self._draw(target)
            if pending and now_s >= pending[0].time_s:
                visit = pending.pop(0)
                off_mm = 1000.0 * float(np.linalg.norm(place - visit.position))
                rospy.loginfo("%s at %g s: the tip is %.1f mm from it", visit.colour, now_s, off_mm)
        self._plot(times_s, positions)

    def _draw(self, target: TransformStamped) -> None:
        self._drawn.poses.append(PoseStamped(target.header, as_pose(target.transform)))
        self._path.publish(self._drawn)

    def _plot(self, times_s: list[float], positions: Array) -> None:
        """Writes a picture of waypoints, target and tip over time to the file `~plot`, if the parameter is given.

        Args:
            times_s: Times of the waypoints [s].
            positions: Positions of the waypoints, shape (3, n) [m].
        """
        name = rospy.get_param("~plot", "")
        if not name or not self._rows:
            return
        from matplotlib.figure import Figure  # importing it takes half a second, only needed for a picture

        figure = Figure(figsize=(9.0, 6.0), layout="constrained")
        draw_motion(figure, self._rows, times_s, positions)
        path = Path(rospy.get_param("~working_directory", ".").strip(), name)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_file(path) as part:
                figure.savefig(part, dpi=200)
        except (OSError, ValueError) as error:
            raise InterfaceError(f"plot: expected a picture file that can be written, got '{path}': {error}") from error
        rospy.loginfo("the motion is drawn in %s", path)


def as_message(rows: Array) -> Float64MultiArray:
    """Converts a matrix to the message that `interpolation_node.py` reads: row by row, with labelled dimensions."""
    count, columns = rows.shape
    dimensions = [MultiArrayDimension("rows", count, rows.size), MultiArrayDimension("columns", columns, columns)]
    return Float64MultiArray(MultiArrayLayout(dimensions, 0), rows.ravel().tolist())


def main() -> None:
    """Runs the node."""
    run_node("run_interpolation", RunInterpolation, RunInterpolation.run)
