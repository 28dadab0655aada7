"""Modules named as in the package `dmp` of the authors' release; see `motion_primitives`."""
