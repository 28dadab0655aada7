"""Motion capture by Xsens MVN: its stream, the bodies that it shows, recordings."""
