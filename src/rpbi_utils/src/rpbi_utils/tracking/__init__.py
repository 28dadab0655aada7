"""Objects of a tracking system: filters of their poses, and tags in images."""
