"""Costs of predicted states, for model predictive control by sampling."""

from rpbi.world import World

GOAL = (-0.1, 0.1)
"""Goal of the middle of the box [m]."""
BEHIND_M = 0.09
"""Distance of the hand behind the middle of the box, seen from the goal [m]."""
HEIGHT_M = 0.06
"""Height of the hand above the floor [m]."""
PER_M2 = 10.0
"""Cost of the box's distance, squared, relative to that of the hand."""


def box_to_goal(world: World) -> float:
    """Returns the squared distances of the box from its goal and of the hand from the place behind the box [m^2]."""
    box, arm = world.bodies["box"].base_pose().position, world.bodies["kuka_lwr"]
    hand = arm.link_pose(arm.link_indices[-1]).position
    place = (box[0], box[1] - BEHIND_M, HEIGHT_M)
    to_goal = (box[0] - GOAL[0]) ** 2 + (box[1] - GOAL[1]) ** 2
    return PER_M2 * to_goal + sum((actual - desired) ** 2 for actual, desired in zip(hand, place, strict=True))
