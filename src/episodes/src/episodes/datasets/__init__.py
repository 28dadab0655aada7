"""Episodes as data sets of other projects: formats, what is stored with each of them, and checks."""
