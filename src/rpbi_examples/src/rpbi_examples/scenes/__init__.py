"""Scenes: robot tasks in a world, with a score. To add a scene, write its class in a new file, and add an entry to
`SCENES`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from custom_ros_tools.plugin_table import PluginTable

if TYPE_CHECKING:
    from .scene import Scene

SCENES: PluginTable[Scene] = PluginTable(
    "scene",
    "rpbi_examples.scenes.scene:Scene",
    {
        "cup": "rpbi_examples.scenes.cup:Cup",
        "wiping": "rpbi_examples.scenes.wiping:Wiping",
        "handover": "rpbi_examples.scenes.handover:Handover",
        "talos": "rpbi_examples.scenes.talos:Talos",
        "factory": "rpbi_examples.scenes.factory:Factory",
        "dual_arm": "rpbi_examples.scenes.dual_arm:DualArm",
        "shelves": "rpbi_examples.scenes.shelves:Shelves",
    },
)
"""All scenes. A scene's module is imported on look-up, since some scenes need optional dependencies."""
