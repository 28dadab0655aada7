"""Classes of the package `motion_primitives`, importable as in the authors' original package `dmp`."""
