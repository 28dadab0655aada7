"""The planner `rrt_connect`: RRT-Connect (Kuffner and LaValle, 2000)."""

from .ompl_planner import OmplPlanner


class RrtConnect(OmplPlanner):
    """RRT-Connect: two trees, from the start and from the goals, that grow towards each other; the first path."""

    method = "RRTConnect"
