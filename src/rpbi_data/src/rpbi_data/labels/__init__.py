"""Data sets of labelled images of a world: masks, boxes and poses of the objects that lie in it."""
