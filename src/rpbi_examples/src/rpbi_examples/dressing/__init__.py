"""An arm draws a sleeve over that of a person."""
