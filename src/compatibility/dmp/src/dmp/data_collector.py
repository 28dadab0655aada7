"""Recording of demonstrations, under the release's names."""

from motion_primitives.ros.data_collector import DMPDataCollector as DMPDataCollector
from motion_primitives.ros.data_collector import TFPositionDMPDataCollector as TFPositionDMPDataCollector
