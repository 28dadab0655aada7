"""Table of the mappings. A new mapping needs a class in a file of its own and a line in this table."""

from custom_ros_tools.plugin_table import PluginTable

from .mapping import Mapping

MAPPINGS: PluginTable[Mapping] = PluginTable(
    "mapping",
    "operator_node.mappings.mapping:Mapping",
    {
        "scale": "operator_node.mappings.scale:ScaleMapping",
        "isometric": "operator_node.mappings.isometric:IsometricMapping",
    },
)
"""All mappings."""
