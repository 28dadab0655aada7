"""The planner `bit_star`: BIT*, Batch Informed Trees (Gammell, Srinivasa and Barfoot, 2015)."""

from .ompl_planner import OmplPlanner


class BitStar(OmplPlanner):
    """BIT*: searches batches of samples in the order of the expected length; better paths until the time is up."""

    method = "BITstar"
    improves = True
