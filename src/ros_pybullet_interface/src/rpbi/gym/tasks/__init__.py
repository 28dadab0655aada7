"""The tasks of environments. To add a task, write its class in a new file, and add a line to `TASKS`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from custom_ros_tools.plugin_table import PluginTable

if TYPE_CHECKING:
    from rpbi.gym.task import WorldTask

TASKS: PluginTable[WorldTask] = PluginTable(
    "task",
    "rpbi.gym.task:WorldTask",
    {
        "reach": "rpbi.gym.tasks.reach:ReachTask",
        "push": "rpbi.gym.tasks.push:PushTask",
        "lift": "rpbi.gym.tasks.lift:LiftTask",
        "wipe": "rpbi.gym.tasks.wipe:WipeTask",
        "peg": "rpbi.gym.tasks.peg:PegTask",
    },
)
"""All tasks; each is imported when it is looked up, since tasks need Gymnasium."""
