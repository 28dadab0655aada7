"""Topics and parameters that the node has whatever is in its world."""

from __future__ import annotations

from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Int64, String
from visualization_msgs.msg import MarkerArray

from ros_pybullet_interface.msg import SimulationState, WorldCommands
from rpbi.ros.publishers.world_markers import MARKERS_TOPIC


class NodeTopic(NamedTuple):
    """A topic that the node publishes.

    Attributes:
        name: Its name.
        message_type: Its ROS type.
        key: Key of the main file that sets its rate in wall time, where 0 is off; empty if there is none.
        meaning: What it tells, in a sentence.
    """

    name: str
    message_type: type
    key: str
    meaning: str


NODE_TOPICS = (
    NodeTopic("rpbi/status", Int64, "status_hz", "1 while the world runs, 0 while it stands still; `status_hz`."),
    NodeTopic(
        "rpbi/state",
        SimulationState,
        "state_hz",
        "Tick, time, real-time factor and hash of the state; `state_hz`, `state_hash_hz`.",
    ),
    NodeTopic("rpbi/commands", WorldCommands, "", "What enters the world, by tick, for replays; as it comes."),
    NodeTopic("rpbi/world_description", String, "", "The world as loaded, as JSON, for replays; latched."),
    NodeTopic(
        MARKERS_TOPIC,
        MarkerArray,
        "markers_hz",
        "All visual shapes, for RViz; latched, sent when something comes, goes or moves; `markers_hz`.",
    ),
    NodeTopic("/diagnostics", DiagnosticArray, "", "Real-time factor, overruns, lost time, renderer; 1 Hz."),
    NodeTopic("/clock", Clock, "", "The world's time, if `/use_sim_time` is true; every tick, or `clock_hz`."),
)


class Parameter(NamedTuple):
    """A parameter of the node.

    Attributes:
        name: Its name, with `NAME` for a robot.
        is_set: Whether the node sets it, else it reads it.
        meaning: What it says, in a sentence.
    """

    name: str
    is_set: bool
    meaning: str


PARAMETERS = (
    Parameter("~config", False, "The main YAML file as a mapping; required."),
    Parameter(
        "use_sim_time", False, "Whether stamps are the world's time, else wall time; from here or a namespace above."
    ),
    Parameter(
        "robot_description",
        False,
        "URDF of robots whose `fileName` is `robot_description`; from here or a namespace above.",
    ),
    Parameter("rpbi/NAME/robot_description", True, "URDF of a robot, for RViz and robot_state_publisher."),
)
