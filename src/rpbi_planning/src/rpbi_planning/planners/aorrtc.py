"""The planner `aorrtc`: AORRTC, an almost-surely asymptotically optimal RRT-Connect."""

from .ompl_planner import OmplPlanner


class Aorrtc(OmplPlanner):
    """AORRTC: repeats RRT-Connect with bounds on the cost; the path gets shorter until the time is up."""

    method = "AORRTC"
    improves = True
