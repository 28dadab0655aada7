"""Poses of a hand that carries upright boxes between two bookcases, for the example `planning_example`."""

from __future__ import annotations

from typing import NamedTuple

from robot_model.geometry import Pose, Vector, plus

LINK = "panda_grasptarget"
"""Link between the fingertips. Its z axis points away from the hand; the fingers close along its y axis."""
BEFORE_M, NEAR_M, LIFT_M, GAP_M = 0.12, 0.045, 0.02, 0.003
"""Distance of the hand in front of a box before and after a grasp, distance at which the fingers are just clear of the
box, height of the lift before the transport, and height above the board at which the box is released [m].
"""


class Bookcase(NamedTuple):
    """A bookcase to the left or to the right of the robot.

    Attributes:
        name: Name of the body.
        side: 1 for the side of positive y, -1 for the other side.
    """

    name: str
    side: float

    def hand_at(self, place: Vector) -> Pose:
        """Returns the pose of `LINK` at a position in the world [m]: into the bookcase, with level fingers."""
        return Pose(place, (-0.5 * self.side, 0.5, 0.5 * self.side, 0.5))

    def in_front(self, place: Vector, distance_m: float = BEFORE_M) -> Pose:
        """Returns the pose of `LINK` at a distance in front of a box at a position in the world [m]."""
        return self.hand_at(plus(place, (0.0, -distance_m * self.side, 0.0)))

    def has(self, place: Vector) -> bool:
        """Returns whether the middle of a box at a position in the world [m] is in the bookcase."""
        x, y, z = place
        return abs(x - 0.3) < 0.3 and 0.49 < self.side * y < 0.75 and z > 0.2


LEFT, RIGHT = Bookcase("left_shelf", 1.0), Bookcase("right_shelf", -1.0)


class Step(NamedTuple):
    """A step of the hand: a motion to a pose, or a motion of the fingers.

    Attributes:
        pose: Goal of `LINK` in the world; None for a motion of the fingers.
        finger: Goal of each finger [m]; None for a motion of the hand.
        held: Whether the hand holds the box during the motion.
        may_touch: Name of the body that the held box may touch; empty for none.
    """

    pose: Pose | None = None
    finger: float | None = None
    held: bool = False
    may_touch: str = ""


OPEN, CLOSED = Step(finger=0.04), Step(finger=0.0)


def carry(box: Vector, source: Bookcase, goal: Bookcase) -> tuple[Step, ...]:
    """Returns the steps that carry a box into another bookcase, to the place opposite to the present one.

    Args:
        box: Position of the box's middle in the world [m].
        source: Bookcase in which the box is.
        goal: The other bookcase.
    """
    x, y, z = box
    place = (x, goal.side * abs(y), z + GAP_M)
    return (
        Step(source.in_front(box)),
        Step(source.in_front(box, NEAR_M)),
        Step(source.hand_at(box)),
        CLOSED,
        Step(source.hand_at(plus(box, (0.0, 0.0, LIFT_M))), held=True, may_touch=source.name),
        Step(goal.hand_at(plus(place, (0.0, 0.0, LIFT_M))), held=True),
        Step(goal.hand_at(place), held=True, may_touch=goal.name),
        OPEN,
        Step(goal.in_front(place, NEAR_M)),  # on the way out, the box is between the fingers
        Step(goal.in_front(place)),
    )
