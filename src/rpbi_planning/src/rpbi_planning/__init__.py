"""Motion planning: from a start to a goal without contact, proven along the whole motion, timed within the limits.

The names are imported when they are used, so that commands and messages work without the extra `planning`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .constraints import OnPlane as OnPlane
    from .constraints import PathConstraint as PathConstraint
    from .constraints import Upright as Upright
    from .constraints import WithinCone as WithinCone
    from .constraints import constraint_from as constraint_from
    from .goals import JointGoal as JointGoal
    from .goals import NamedGoal as NamedGoal
    from .goals import PlanningGoal as PlanningGoal
    from .goals import PoseGoal as PoseGoal
    from .goals import RegionGoal as RegionGoal
    from .goals import goal_from as goal_from
    from .planning import PlanResult as PlanResult
    from .planning import plan as plan
    from .scene import PlanningScene as PlanningScene
    from .timing import PlannedTrajectory as PlannedTrajectory

_MODULES = {
    "constraints": ("OnPlane", "PathConstraint", "Upright", "WithinCone", "constraint_from"),
    "goals": ("PlanningGoal", "JointGoal", "NamedGoal", "PoseGoal", "RegionGoal", "goal_from"),
    "planning": ("PlanResult", "plan"),
    "scene": ("PlanningScene",),
    "timing": ("PlannedTrajectory",),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
