"""The tasks of environments; a new one is a class in a file of its own and a line here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from custom_ros_tools.plugins.table import PluginTable

if TYPE_CHECKING:
    from rpbi.gym.task import Task

TASKS: PluginTable[Task] = PluginTable(
    "task",
    "rpbi.gym.task:Task",
    {
        "reach": "rpbi.gym.tasks.reach:Reach",
        "push": "rpbi.gym.tasks.push:Push",
        "lift": "rpbi.gym.tasks.lift:Lift",
        "wipe": "rpbi.gym.tasks.wipe:Wipe",
        "peg": "rpbi.gym.tasks.peg:Peg",
    },
)
"""All tasks; each is imported when it is looked up, since they need Gymnasium."""
