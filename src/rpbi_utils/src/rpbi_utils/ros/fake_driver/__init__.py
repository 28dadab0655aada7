"""The node that emulates the driver of a robot."""
