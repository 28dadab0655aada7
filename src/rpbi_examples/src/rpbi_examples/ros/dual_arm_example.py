"""Moves two arms so that their hands draw mirrored circles, by the simulator's inverse kinematics."""

from __future__ import annotations

import sys

import rospy

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.run_node import run_node
from ros_pybullet_interface.msg import CalculateInverseKinematicsProblem
from ros_pybullet_interface.srv import ResetEffState
from rpbi_examples.circles import POINTING_DOWN, hand_position

HZ = 50.0
LINK = "lbr_iiwa_link_7"
APPROACH_S = 3.0
"""Time for the way to the circles [s]."""


def main() -> None:
    """Runs the node for the two robots that the arguments name, the left one first."""
    run_node("dual_arm_example", _run)


def _run() -> None:
    names = rospy.myargv(sys.argv)[1:]
    if len(names) != 2:
        raise InterfaceError(f"expected the names of two robots, got {len(names)}")
    sides = dict(zip(names, (1.0, -1.0)))
    for name, side in sides.items():
        _approach(name, side)
    _draw(sides)


def _problem(time_s: float, side: float) -> CalculateInverseKinematicsProblem:
    return CalculateInverseKinematicsProblem(
        link_name=LINK, targetPosition=hand_position(time_s, side), targetOrientation=POINTING_DOWN
    )


def _approach(name: str, side: float) -> None:
    service = f"rpbi/{name}/move_to_eff_state"
    rospy.wait_for_service(service)
    answer = rospy.ServiceProxy(service, ResetEffState)(_problem(0.0, side), APPROACH_S)
    if not answer.success:
        raise InterfaceError(f"{service}: {answer.message}")


def _draw(sides: dict[str, float]) -> None:
    publishers = {
        name: rospy.Publisher(f"rpbi/{name}/ik", CalculateInverseKinematicsProblem, queue_size=1) for name in sides
    }
    rate = rospy.Rate(HZ)
    start = rospy.Time.now()
    while not rospy.is_shutdown():
        time_s = (rospy.Time.now() - start).to_sec()
        for name, side in sides.items():
            publishers[name].publish(_problem(time_s, side))
        rate.sleep()
