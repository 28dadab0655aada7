"""Slider and pusher in the plane: sizes, quasi-static motion, paths, and the estimate of their poses."""
