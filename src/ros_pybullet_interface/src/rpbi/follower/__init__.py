"""The process that follows a world, and forks itself."""
