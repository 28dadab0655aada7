"""The table of planners. To add a planner, write a class in a new file, and add a line to the table."""

from custom_ros_tools.plugin_table import PluginTable
from rpbi_planning.planner import Planner

PLANNERS: PluginTable[Planner] = PluginTable(
    "planner",
    "rpbi_planning.planner:Planner",
    {
        "rrt_connect": "rpbi_planning.planners.rrt_connect:RrtConnect",
        "aorrtc": "rpbi_planning.planners.aorrtc:Aorrtc",
        "bit_star": "rpbi_planning.planners.bit_star:BitStar",
        "prm": "rpbi_planning.planners.prm:Prm",
        "projected": "rpbi_planning.planners.projected:ProjectedRrt",
    },
)
"""All planners, indexed by name."""
