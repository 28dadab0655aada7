"""How far a robot is with its trajectory."""

from typing import NamedTuple

from .trajectory import State


class ControllerState(NamedTuple):
    """Where the joints of a follower of trajectories are to be, and where they are.

    Attributes:
        name: The robot.
        joint_names: n names.
        desired: Where they are to be; the positions that motors hold while there is no trajectory.
        position: n positions [rad or m], measured.
        velocity: n velocities [rad/s or m/s], measured.
        time_from_start_s: Time since the trajectory began [s], 0 while there is none.
    """

    name: str
    joint_names: tuple[str, ...]
    desired: State
    position: tuple[float, ...]
    velocity: tuple[float, ...]
    time_from_start_s: float
