"""The node that stands in for the driver of a robot."""
