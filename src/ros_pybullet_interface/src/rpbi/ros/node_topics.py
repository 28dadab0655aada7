"""Topics and parameters that the node has whatever is in its world."""

from typing import NamedTuple

from rpbi.ros.publishers.attachments import ATTACHMENTS
from rpbi.ros.publishers.commands import COMMANDS, DESCRIPTION
from rpbi.ros.publishers.status import CLOCK, DIAGNOSTICS, STATE, STATUS
from rpbi.ros.publishers.world_markers import MARKERS

NODE_TOPICS = (STATUS, STATE, ATTACHMENTS, COMMANDS, DESCRIPTION, MARKERS, DIAGNOSTICS, CLOCK)
"""Topics that the node publishes."""


class NodeParameter(NamedTuple):
    """A parameter of the node.

    Attributes:
        name: Its name, with `NAME` for a robot.
        is_set: Whether the node sets it, else it reads it.
        meaning: Its purpose, in a sentence.
    """

    name: str
    is_set: bool
    meaning: str


PARAMETERS = (
    NodeParameter("~config_file", False, "The main YAML file; a relative path is looked for in `~working_directory`."),
    NodeParameter("~working_directory", False, "Folder that a relative `~config_file` is in."),
    NodeParameter("~state_folder", False, "Folder of `rpbi/save` and `rpbi/restore`; the user's home by default."),
    NodeParameter(
        "~max_predicted_ticks", False, "Most ticks of all candidates of a `rpbi/predict`; 1,000,000 by default."
    ),
    NodeParameter(
        "~real_time_priority",
        False,
        "Whether the node runs with real-time priority while it needs less than half a processor; true by default.",
    ),
    NodeParameter(
        "~config",
        False,
        "The main YAML file as a mapping, or with `~config_file` the keys that differ; one of both is required.",
    ),
    NodeParameter(
        "use_sim_time", False, "Whether stamps are the world's time, else wall time; from here or a namespace above."
    ),
    NodeParameter(
        "robot_description",
        False,
        "URDF of robots whose `fileName` is `robot_description`; from here or a namespace above.",
    ),
    NodeParameter("rpbi/NAME/robot_description", True, "URDF of a robot, for RViz and robot_state_publisher."),
)
