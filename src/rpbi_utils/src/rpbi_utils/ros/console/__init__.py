"""Commands of the console for a running simulator."""
