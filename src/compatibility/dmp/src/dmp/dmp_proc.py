"""Learning and planning by the release's services, under the release's names."""

from motion_primitives.ros.dmp_services import DMPProcessor as DMPProcessor
