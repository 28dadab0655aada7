"""Records demonstrations; the classes have the names of the authors' original release."""

from motion_primitives.ros.data_collector import DMPDataCollector as DMPDataCollector
from motion_primitives.ros.data_collector import TFPositionDMPDataCollector as TFPositionDMPDataCollector
