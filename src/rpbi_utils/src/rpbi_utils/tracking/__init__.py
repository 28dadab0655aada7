"""Objects that a tracking system sees: what is made of their poses, and tags in images."""
