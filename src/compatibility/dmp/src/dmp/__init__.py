"""Modules with the names of the package `dmp` in the authors' original release; see `motion_primitives`."""
