"""Learns and plans motions through the services, and with the class name, of the authors' original release."""

from motion_primitives.ros.dmp_services import DMPProcessor as DMPProcessor
