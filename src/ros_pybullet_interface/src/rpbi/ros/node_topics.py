"""Topics and parameters that the node has whatever is in its world."""

from typing import NamedTuple

from rpbi.ros.publishers.attachments import ATTACHMENTS
from rpbi.ros.publishers.commands import COMMANDS, DESCRIPTION
from rpbi.ros.publishers.status import CLOCK, DIAGNOSTICS, STATE, STATUS
from rpbi.ros.publishers.world_markers import MARKERS

NODE_TOPICS = (STATUS, STATE, ATTACHMENTS, COMMANDS, DESCRIPTION, MARKERS, DIAGNOSTICS, CLOCK)
"""What it publishes."""


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
    Parameter("~config_file", False, "The main YAML file; a relative path is looked for in `~working_directory`."),
    Parameter("~working_directory", False, "Folder that a relative `~config_file` is in."),
    Parameter(
        "~config",
        False,
        "The main YAML file as a mapping, or with `~config_file` the keys that differ; one of both is required.",
    ),
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
