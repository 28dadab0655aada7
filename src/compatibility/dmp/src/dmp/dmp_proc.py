"""Client of the node that learns and plans motions, importable as in the authors' original package `dmp`."""

from motion_primitives.ros.dmp_services import DMPProcessor as DMPProcessor
