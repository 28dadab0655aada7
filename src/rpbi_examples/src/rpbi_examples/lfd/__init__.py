"""Learning from demonstration: a person who pushes a box, the skill that is learned, and the report of a session."""
