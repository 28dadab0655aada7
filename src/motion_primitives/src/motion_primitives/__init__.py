"""Movement primitives, which are learned from demonstrations and executed with new starts, goals and durations."""

from .coupling import ForceCoupling as ForceCoupling
from .coupling import ObstacleCoupling as ObstacleCoupling
from .demonstration import Demonstration as Demonstration
from .files import load as load
from .files import save as save
from .primitive import MotionPlan as MotionPlan
from .primitive import Primitive as Primitive
from .primitive import ViaPoint as ViaPoint
from .primitives import PRIMITIVES

make_primitive = PRIMITIVES.make
"""Makes a primitive whose type is given by name, see `PluginTable.make`."""
