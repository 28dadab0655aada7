"""Motion capture by Xsens MVN: its stream, the people in it, and recordings."""
