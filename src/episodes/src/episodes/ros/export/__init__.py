"""Episodes as data sets: features of recordings, rows of one rate, and the export of a folder."""
