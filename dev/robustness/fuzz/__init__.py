"""Hostile targets for the guard, and an oracle that judges the resulting commands."""
