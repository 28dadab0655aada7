"""The names of the release's package `dmp`; see `motion_primitives`."""
