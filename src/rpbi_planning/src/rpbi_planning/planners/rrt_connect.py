"""The planner `rrt_connect`: RRT-Connect (Kuffner and LaValle, 2000)."""

from pydantic import Field

from custom_ros_tools.schema import NonNegative

from .ompl_planner import OmplConfig, OmplPlanner


class RrtConnectConfig(OmplConfig):
    """Options of RRT-Connect. In narrow passages, shorter motions succeed more often than OMPL's choice of 3 rad."""

    range: NonNegative = Field(1.5, description="Longest motion that is tried at once [rad or m]; 0: OMPL's choice.")


class RrtConnect(OmplPlanner):
    """RRT-Connect: two trees, from the start and from the goals, that grow towards each other; the first path."""

    Config = RrtConnectConfig
    method = "RRTConnect"
