"""The mappings; a new one is a class in its own file and a line here."""

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
