"""Moves an arm that pushes a box back and forth; the position of the box is looked up in TF."""

import math
from itertools import cycle

import rospy

from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.tf_interface import TfInterface
from rpbi_examples.motions import PlanarPose
from rpbi_examples.pushing import PLACES, Pusher, ball_solver, next_push

from .joint_targets import HZ, JointTargets

ROBOT = "kuka_lwr"
REST_S = 0.5
"""Time for which the arm rests at first, and between two checks of a box that is out of reach [s]."""


def main() -> None:
    """Runs the node."""
    run_node("push_example", _run)


def _run() -> None:
    tf, arm, pusher = TfInterface(), JointTargets(ROBOT), Pusher(ball_solver())
    positions = arm.positions
    _rest(arm, positions)
    for goal in cycle(PLACES):
        while (push := next_push(_box(tf), goal)) is not None:
            try:
                moves = pusher.moves(positions, push)
            except ValueError as error:
                rospy.logwarn_throttle(10.0, f"the box cannot be pushed: {error}")
                _rest(arm, positions)
                continue
            for move in moves:
                ticks = round(move.duration_s * HZ)
                for tick in range(1, ticks + 1):
                    positions = move.at(tick / ticks * move.duration_s)
                    arm.send(positions)


def _rest(arm: JointTargets, positions: tuple[float, ...]) -> None:
    for _ in range(round(REST_S * HZ)):
        arm.send(positions)


def _box(tf: TfInterface) -> PlanarPose:
    """Returns where the box is in the frame of the arm's base."""
    position, quat = TfInterface.msg_to_pos_quat(tf.wait_for_tf_msg(f"rpbi/{ROBOT}/base", "rpbi/box"))
    return PlanarPose(position[0], position[1], 2.0 * math.atan2(quat[2], quat[3]))
