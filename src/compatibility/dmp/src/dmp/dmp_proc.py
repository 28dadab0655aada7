"""Learning and planning through the services of the authors' release, with the release's class names."""

from motion_primitives.ros.dmp_services import DMPProcessor as DMPProcessor
