"""Mimic joints, such as the fingers of a gripper with one motor."""

from collections.abc import Mapping

import pybullet

from rpbi.engine.client import Client
from rpbi.urdf.joints import Coupling

_LARGEST_EFFORT = 1e6
_ERP = 1.0
"""PyBullet multiplies this with its own share of an error that is corrected in a step, which other joints have too."""


def couple(pb: Client, body_id: int, couplings: Mapping[int, Coupling]) -> None:
    """Couples joints to others from now on, as if by gears; their own motors are disabled.

    Args:
        couplings: The coupling of each, by joint index.
    """
    for index, (leader, multiplier, offset) in couplings.items():
        pb.setJointMotorControl2(body_id, index, pybullet.VELOCITY_CONTROL, force=0.0)
        gear = pb.createConstraint(
            body_id, index, body_id, leader, pybullet.JOINT_GEAR, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        )
        pb.changeConstraint(
            gear, gearRatio=-multiplier, relativePositionTarget=offset, erp=_ERP, maxForce=_LARGEST_EFFORT
        )
