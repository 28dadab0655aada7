"""Commands for the examples."""
