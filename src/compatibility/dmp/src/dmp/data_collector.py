"""Recording of demonstrations, with the class and function names of the authors' release."""

from motion_primitives.ros.data_collector import DMPDataCollector as DMPDataCollector
from motion_primitives.ros.data_collector import TFPositionDMPDataCollector as TFPositionDMPDataCollector
