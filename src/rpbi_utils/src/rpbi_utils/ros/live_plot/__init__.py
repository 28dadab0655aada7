"""A window with numeric fields of running topics as lines over time."""
