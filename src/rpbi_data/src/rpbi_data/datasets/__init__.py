"""Episodes as data sets in formats of other projects: writing, provenance, and checks."""
