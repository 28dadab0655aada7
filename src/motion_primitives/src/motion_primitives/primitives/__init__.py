"""The table of primitives. To add a primitive, write a class in a new file, and add a line to the table."""

from custom_ros_tools.plugin_table import PluginTable
from motion_primitives.primitive import Primitive

PRIMITIVES: PluginTable[Primitive] = PluginTable(
    "primitive",
    "motion_primitives.primitive:Primitive",
    {
        "dmp": "motion_primitives.primitives.dmp:DMP",
        "rhythmic_dmp": "motion_primitives.primitives.rhythmic_dmp:RhythmicDMP",
        "promp": "motion_primitives.primitives.promp:ProMP",
    },
)
"""All primitives, indexed by name."""
