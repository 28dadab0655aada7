"""Asks the simulator what a planned motion will do, and compares the answer with what it did."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rospy

from custom_ros_tools.errors import InterfaceError
from robot_model.geometry import Pose
from ros_pybullet_interface.msg import Candidate, PlannedInput, Prediction
from ros_pybullet_interface.srv import Predict
from rpbi_planning.foresee import SETTLING_S

SERVICE = "rpbi/predict"
SERVER_S = 5.0
"""Longest time to wait for the service [s]."""
EVERY_S = 0.005
"""Time between two samples of the prediction [s]."""
MOVED_M = 1e-3
"""Least displacement of a body that is mentioned [m]."""


def predicted(
    robot: str, joint_names: Sequence[str], trajectory: Any, present: Mapping[str, Pose], dt_s: float
) -> tuple[Prediction, str]:
    """Simulates a motion in a copy of the running world, which itself does not change.

    Args:
        robot: Name of the robot.
        joint_names: Names of the n joints that move.
        trajectory: Has `duration_s` [s], and `at(times)`, which returns positions of shape (k, n) [rad or m].
        present: Present poses of the bodies that are watched, indexed by name.
        dt_s: Duration of a tick [s].

    Returns:
        The prediction, and a summary: contacts of the robot, and bodies that move.

    Raises:
        InterfaceError: If the simulator does not answer, or cannot predict the motion.
    """
    moving = math.ceil(trajectory.duration_s / dt_s)
    targets = trajectory.at(np.arange(1, moving + 1) * dt_s).tolist()
    inputs = [PlannedInput(tick, f"{robot}/target", list(joint_names), q) for tick, q in enumerate(targets)]
    ticks, every = moving + round(SETTLING_S / dt_s), max(round(EVERY_S / dt_s), 1)
    ticks += -ticks % every  # so that the last state is among the samples
    try:
        rospy.wait_for_service(SERVICE, SERVER_S)
        answer = rospy.ServiceProxy(SERVICE, Predict)(
            candidates=[Candidate(inputs)], ticks=ticks, watch=[robot, *present], every=every
        )
    except (rospy.ROSException, rospy.ServiceException) as error:
        raise InterfaceError(f"foresee: {SERVICE}: {error}") from None
    fault = answer.predictions[0].fault if answer.success else answer.message
    if fault:
        raise InterfaceError(f"foresee: {SERVICE}: {fault}")
    prediction: Prediction = answer.predictions[0]
    return prediction, _summary(robot, prediction, present)


def poses_at_end(prediction: Prediction) -> dict[str, Pose]:
    """Returns the last pose of each watched body, indexed by name."""
    last = {body.name: body.poses[-1] for body in prediction.bodies}
    return {
        name: Pose(
            (each.position.x, each.position.y, each.position.z),
            (each.orientation.x, each.orientation.y, each.orientation.z, each.orientation.w),
        )
        for name, each in last.items()
    }


def distances_m(before: Mapping[str, Pose], after: Mapping[str, Pose]) -> dict[str, float]:
    """Returns the distance between two positions of each body [m], indexed by the names in `before`."""
    return {name: math.dist(pose.position, after[name].position) for name, pose in before.items()}


def _summary(robot: str, prediction: Prediction, present: Mapping[str, Pose]) -> str:
    force_n = max((force for each in prediction.bodies if each.name == robot for force in each.contacts), default=0.0)
    parts = [f"contacts of '{robot}' up to {force_n:.0f} N" if force_n else f"no contacts of '{robot}'"]
    moved = distances_m(present, poses_at_end(prediction))
    parts += [f"'{name}' moves by {1e3 * each:.0f} mm" for name, each in moved.items() if each > MOVED_M]
    return f"foreseen: {'; '.join(parts)}"
