"""Model predictive control in simulation and on hardware, with one measurement, plan and command in each cycle."""

from .controller import ControlPlan as ControlPlan
from .controller import MpcController as MpcController
from .controller import Plant as Plant
from .controller import Sensed as Sensed
from .loop import LockStep as LockStep
from .loop import LoopConfig as LoopConfig
from .records import write_records as write_records
