"""Table of the data set formats. To add a format, write a class in a new file, and add a line to the table."""

from pathlib import Path

from custom_ros_tools.errors import MissingDependency
from custom_ros_tools.plugin_table import PluginTable
from rpbi_data.datasets.format import DatasetError, DatasetFormat

FORMATS: PluginTable[DatasetFormat] = PluginTable(
    "data set format",
    "rpbi_data.datasets.format:DatasetFormat",
    {
        "lerobot": "rpbi_data.datasets.formats.lerobot:LeRobot",
        "robomimic": "rpbi_data.datasets.formats.robomimic:Robomimic",
        "mcap": "rpbi_data.datasets.formats.mcap:Mcap",
    },
)
"""All formats, indexed by name."""


def format_of(folder: Path, others: tuple[str, ...] = ()) -> type[DatasetFormat]:
    """Returns the format that recognises a data set.

    Args:
        folder: The data set.
        others: Further formats, as `module:Class`, which are tried after the formats of the table.

    Raises:
        DatasetError: If the folder does not exist, or no format recognises the data set.
        MissingDependency: If no installed format recognises the data set, and the library of another format is missing.
    """
    if not folder.is_dir():
        raise DatasetError(folder, "expected a folder with a data set, there is none")
    missing: MissingDependency | None = None
    for name in (*FORMATS, *others):
        try:
            found = FORMATS.find(name)
            if found.recognises(folder):
                return found
        except MissingDependency as error:  # another format may recognise the folder
            missing = error
    if missing:
        raise missing
    names = sorted(each.name for each in folder.iterdir())
    content = ", ".join(names[:10]) + (" ..." if len(names) > 10 else "") or "nothing"
    *some, last = (each.content for each in FORMATS.values())
    expected = f"{', '.join(some)}, or {last}"
    raise DatasetError(folder, f"not a data set of a known format: expected {expected}, found {content}")
