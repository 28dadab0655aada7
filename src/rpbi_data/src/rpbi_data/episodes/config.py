"""Parameters of the node that records episodes."""

from typing import Annotated

from pydantic import Field

from custom_ros_tools.schema import ConfigModel, Count, ListOf, Positive, Switch, Text, optional

DEFAULT_TOPICS = (
    r".*/(rpbi/(world_description|commands|state)|joint_states(/[a-z_]+)*|target|command|cmd_vel"
    r"|[^/]*ft_sensor[^/]*(/wrench)?|wrench|contacts)|/tf|/tf_static|/clock"
)
"""Topics of replays, joint states and targets, commands after a guard, wrenches, contacts, TF and the clock."""

_Index = Annotated[Count, Field(strict=False)]
"""Index that is a key in a ROS parameter, where keys are text."""


class RecordParameters(ConfigModel):
    """Parameters of `record_node.py`."""

    folder: Text = Field(description="Folder of the episodes, which is created if necessary.")
    topics: ListOf[Text] | Text = Field(
        DEFAULT_TOPICS,
        description="Recorded topics: a list, or a regular expression that must match the whole name of a topic.",
    )
    also: ListOf[Text] = Field((), description="Topics that are recorded in addition, such as camera images.")
    copy_from: ListOf[Text] = Field(
        (),
        description="Folders from which files that the world uses are stored with episodes, in addition to the "
        "default folders; `[/]` permits all folders.",
    )
    namespace: Text = Field("/", description="Namespace of the simulator.")
    reset: Switch = Field(False, description="Whether the world is reset before each episode.")
    disk_reserve_mb: Positive = Field(1000.0, description="Free disk space that recordings leave unused [MB].")
    seeds: str = Field("", description="Text that is stored with each episode.")
    start_key: Text = Field("r", description="Key that starts an episode, or ends the episode that is being recorded.")
    discard_key: Text = Field(
        "x", description="Key that discards the episode that is being recorded, otherwise the last episode."
    )
    label_keys: dict[str, str] = Field(
        {"s": "success", "f": "failure"},
        description="Labels, keyed by the key that gives the label to the episode that is being recorded, otherwise "
        "to the last episode.",
    )
    start_button: Count | None = optional(
        "Index of the `joy` button with the effect of `start_key`. By default, no button has this effect."
    )
    discard_button: Count | None = optional(
        "Index of the `joy` button with the effect of `discard_key`. By default, no button has this effect."
    )
    label_buttons: dict[_Index, str] = Field(
        {}, description="Labels, keyed by the index (as text) of the `joy` button that gives the label."
    )
