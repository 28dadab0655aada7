"""Commands of the console for worlds."""
