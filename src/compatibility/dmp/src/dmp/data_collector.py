"""Classes that record demonstrations, importable as in the authors' original package `dmp`."""

from motion_primitives.ros.data_collector import DMPDataCollector as DMPDataCollector
from motion_primitives.ros.data_collector import TFPositionDMPDataCollector as TFPositionDMPDataCollector
