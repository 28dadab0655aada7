"""Motion planning: from a start to a goal without contact, proven along the whole motion, timed within the limits."""

from .constraints import OnPlane as OnPlane
from .constraints import PathConstraint as PathConstraint
from .constraints import Upright as Upright
from .constraints import WithinCone as WithinCone
from .constraints import constraint_from as constraint_from
from .goals import Goal as Goal
from .goals import JointGoal as JointGoal
from .goals import NamedGoal as NamedGoal
from .goals import PoseGoal as PoseGoal
from .goals import RegionGoal as RegionGoal
from .goals import goal_from as goal_from
from .plan import PlanResult as PlanResult
from .plan import plan as plan
from .scene import PlanningScene as PlanningScene
from .timing import Trajectory as Trajectory
