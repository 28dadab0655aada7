"""Commands of the console for examples and for the workspace."""
