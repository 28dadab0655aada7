"""Costs of predictions: one that is good, and some that fail."""

import os


def height(world):
    """Returns how high the box is [m]."""
    return world.bodies["box"].base_pose().position[2]


def turned(world):
    """Returns how far the second joint of the arm is from 0.6 rad, squared."""
    return (list(world.bodies["iiwa"].joint_positions().values())[1] - 0.6) ** 2


def broken(world):
    """Raises."""
    raise RuntimeError("no such thing")


def endless(world):
    """Returns what is no number."""
    return float("nan")


def dies(world):
    """Ends its process."""
    os._exit(9)
