"""`pushing_mpc_node.py`: pushes a slider along a path, and shows the plan in RViz. Services start and stop the loop."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import rospy
from geometry_msgs.msg import Point, PoseStamped
from nav_msgs.msg import Path as PathMessage
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from custom_ros_tools.ros.lifecycle.parameters import private_config
from custom_ros_tools.ros.lifecycle.run_node import run_node
from rpbi_mpc.controller import ControlPlan, Sensed
from rpbi_mpc.loop import Cycle
from rpbi_mpc.node_configs import PushingNodeConfig
from rpbi_mpc.pushing.controller import PushingController
from rpbi_mpc.pushing.hand import PlanarHand
from rpbi_mpc.pushing.planar.model import SliderConfig
from rpbi_mpc.pushing.planar.motion import rotation
from rpbi_mpc.pushing.planar.paths import PushPath
from rpbi_mpc.pushing.report import write_report
from rpbi_mpc.pushing.sampling_planner import SamplingPlanner

from .loop_node import LoopNode
from .plants import HandPlant, SteppedPlant, TimedPlant

FRAME = "rpbi/world"
SPACING = 0.005
"""Distance between points of the path in RViz [m]."""
SHOWN_EVERY = 4
"""Number of predicted poses between two outlines of the slider in RViz."""
PLAN, REFERENCE, SEEN = ColorRGBA(0.1, 0.55, 0.9, 0.9), ColorRGBA(0.2, 0.7, 0.3, 0.9), ColorRGBA(0.93, 0.53, 0.14, 0.9)
NODE = "pushing_mpc"


class PushingDisplay:
    """Publishes the display for RViz: `mpc/path` and `mpc/prediction` (nav_msgs/Path), and `mpc/markers` with outlines
    of the slider.

    Args:
        path: Path of the slider.
        slider: Size of the slider.
    """

    def __init__(self, path: PushPath, slider: SliderConfig) -> None:
        self._slider = slider
        self._height = float(rospy.get_param("~display_height", 0.0))
        """Height of paths and outlines in the world [m]."""
        self._path = rospy.Publisher("mpc/path", PathMessage, queue_size=1, latch=True)
        self._prediction = rospy.Publisher("mpc/prediction", PathMessage, queue_size=1, latch=True)
        self._markers = rospy.Publisher("mpc/markers", MarkerArray, queue_size=1, latch=True)
        times = np.arange(0.0, path.duration_s + SPACING / path.speed, SPACING / path.speed)
        self._path.publish(self._path_message(path.poses(times)))

    def show(self, plan: ControlPlan | None, sensed: Sensed) -> None:
        """Publishes the predicted poses of a plan, the measured slider, and the reference."""
        if plan is None or sensed.values is None:
            return
        self._prediction.publish(self._path_message(plan.states[:, :3]))
        reference = np.array([plan.extras[f"reference_{name}"] for name in ("x", "y", "yaw")])
        outlines = [(pose, PLAN) for pose in plan.states[::SHOWN_EVERY, :3]]
        outlines += [(reference, REFERENCE), (sensed.values[:3], SEEN)]
        self._markers.publish(MarkerArray([self._outline(i, *each) for i, each in enumerate(outlines)]))

    def _path_message(self, poses: np.ndarray) -> PathMessage:
        """Converts poses x, y, yaw, shape (N, 3) [m, m, rad], to a path message at the height of the display."""
        message = PathMessage()
        message.header.frame_id = FRAME
        message.poses = [self._pose(pose) for pose in poses]
        return message

    def _pose(self, pose: np.ndarray) -> PoseStamped:
        stamped = PoseStamped()
        stamped.header.frame_id = FRAME
        position, turn = stamped.pose.position, stamped.pose.orientation
        position.x, position.y, position.z = float(pose[0]), float(pose[1]), self._height
        turn.z, turn.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)
        return stamped

    def _outline(self, index: int, pose: np.ndarray, colour: ColorRGBA) -> Marker:
        """Returns a marker with the outline of the slider at a pose x, y, yaw [m, m, rad]."""
        marker = Marker(ns="slider", id=index, type=Marker.LINE_STRIP, action=Marker.ADD, color=colour)
        marker.header.frame_id = FRAME
        marker.scale.x = 0.002
        marker.pose.orientation.w = 1.0
        half = np.array([self._slider.length, self._slider.width]) / 2
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) * half
        places = pose[:2] + corners @ rotation(pose[2]).T
        marker.points = [Point(float(x), float(y), self._height) for x, y in places]
        return marker


class PushingNode(LoopNode):
    """Pushes a slider along a path with a robot's hand.

    Raises:
        ConfigError: If the node's configuration is invalid.
        MissingDependency: If CasADi is not installed.
    """

    def __init__(self) -> None:
        config = private_config(PushingNodeConfig)
        hand, planner = PlanarHand(config.hand), None
        if config.plant.timed:
            self._hand: HandPlant = TimedPlant(config.plant, hand)
        else:
            self._hand = stepped = SteppedPlant(config.plant, hand)
            if config.controller == "sampling":
                planner = SamplingPlanner(stepped, config.pushing, config.sampling)
        self._pushing = PushingController(config.pushing, planner)
        self._display = PushingDisplay(self._pushing.path, config.pushing.slider)
        super().__init__(self._hand, self._pushing, config.loop)

    def show(self, cycle: Cycle) -> None:
        self._display.show(cycle.plan, cycle.sensed)

    def on_stop(self) -> None:
        self._hand.begin_at_the_robot()

    def write_report(self, folder: Path) -> str:
        write_report(folder, self._loop.cycles, self._pushing)
        return self._pushing.failure or self._pushing.result


def main() -> None:
    """Runs the node."""
    run_node(NODE, PushingNode, PushingNode.run, loggers=("rpbi_mpc",))
