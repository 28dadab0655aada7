"""Model predictive control in lock-step: sense, solve, act, step; in simulation and on hardware."""

from .controller import ControlPlan as ControlPlan
from .controller import MpcController as MpcController
from .loop import LockStep as LockStep
from .loop import LoopConfig as LoopConfig
from .plant import Plant as Plant
from .plant import Sensed as Sensed
from .records import write_records as write_records
