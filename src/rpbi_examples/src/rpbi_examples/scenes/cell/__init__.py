"""The work cell of the scene `factory`: a belt with parts, and two arms with grippers that keep a distance."""
