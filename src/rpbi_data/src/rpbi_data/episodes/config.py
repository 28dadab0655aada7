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

    folder: Text = Field(description="Folder of the episodes; it is created.")
    topics: ListOf[Text] | Text = Field(
        DEFAULT_TOPICS, description="A list of topics, or a regular expression that the whole name matches."
    )
    also: ListOf[Text] = Field((), description="Further topics, such as images of cameras.")
    copy_from: ListOf[Text] = Field(
        (), description="Further folders whose files are stored with episodes if the world names them; `[/]` for all."
    )
    namespace: Text = Field("/", description="Namespace of the simulator.")
    reset: Switch = Field(False, description="Whether the world is reset before each episode.")
    disk_reserve_mb: Positive = Field(1000.0, description="Free space of the disk that is never used [MB].")
    seeds: str = Field("", description="Text that is stored with each episode.")
    start_key: Text = Field("r", description="Key that starts an episode, and ends the one that is recorded.")
    discard_key: Text = Field("x", description="Key that discards the episode that is recorded, else the last one.")
    label_keys: dict[str, str] = Field(
        {"s": "success", "f": "failure"}, description="Labels by the keys that give them to the same episode."
    )
    start_button: Count | None = optional("Index of the button of `joy` with the effect of the start key.")
    discard_button: Count | None = optional("Index of the button of `joy` with the effect of the discard key.")
    label_buttons: dict[_Index, str] = Field(
        {}, description="Labels by the index, as text, of the button of `joy` that gives them."
    )
