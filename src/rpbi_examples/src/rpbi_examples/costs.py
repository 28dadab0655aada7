"""Cost of predicted states, for sampling-based model predictive control."""

from rpbi.world import World

GOAL = (-0.1, 0.1)
"""Goal of the middle of the box, x and y [m]."""
BEHIND_M = 0.09
"""Distance of the desired hand position from the middle of the box, along -y [m]."""
HEIGHT_M = 0.06
"""Height of the hand above the floor [m]."""
PER_M2 = 10.0
"""Weight of the box's squared distance from its goal. The hand's squared distance has the weight 1."""


def box_to_goal(world: World) -> float:
    """Returns the weighted sum of two squared distances [m^2]: from the box to its goal, and from the hand to the
    desired position behind the box.
    """
    box, arm = world.bodies["box"].base_pose().position, world.bodies["kuka_lwr"]
    hand = arm.link_pose(arm.link_indices[-1]).position
    place = (box[0], box[1] - BEHIND_M, HEIGHT_M)
    to_goal = (box[0] - GOAL[0]) ** 2 + (box[1] - GOAL[1]) ** 2
    return PER_M2 * to_goal + sum((actual - desired) ** 2 for actual, desired in zip(hand, place, strict=True))
