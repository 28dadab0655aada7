"""Learning and planning by the release's services, under the release's names."""

from motion_primitives.ros.dmp_processor import DMPProcessor as DMPProcessor
