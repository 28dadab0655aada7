"""`kuka_lwr_ik_example.launch`: the arm tracks a figure eight by each solver, and leads a real robot by one of them."""

from __future__ import annotations

import numpy as np
import pytest
import rosgraph
from real_robot import RealRobot
from robot_shape import moved, pose_matrix
from ros_system import wait_until
from tf2_msgs.msg import TFMessage

TIP, TARGET, FIGURE = "rpbi/kuka_lwr/end_effector_ball", "rpbi/figure_eight", "rpbi/figure_eight_base"
LEADING = "kdl"
"""The one with `real_robot:=true`."""
MORE_SOLVERS = ("tasks", "trajectory", "trac_ik", "pybullet", "global", "exotica")
SPAN_M = 0.35
"""The figure is 0.4 m from end to end."""
NEAR_M = 0.01
"""How far off the figure the tip may be; how far it lags behind along the figure is up to the machine."""


def poses(listener, frame):
    """Returns stamps [s] and poses of a frame in its parent, as 4x4 matrices, in the order of their messages."""
    transforms = [each for message in list(listener.messages) for each in message.transforms]
    own = [each for each in transforms if each.child_frame_id == frame]
    stamps_s = np.array([each.header.stamp.to_sec() for each in own])
    return stamps_s, np.array([pose_matrix(each.transform) for each in own]).reshape(-1, 4, 4)


@pytest.mark.thorough
@pytest.mark.parametrize("solver", [pytest.param(LEADING, marks=pytest.mark.alone), *MORE_SOLVERS])
def test_arm_tracks_the_figure(ros, solver):
    moving, still = ros.listen("/tf", TFMessage), ros.listen("/tf_static", TFMessage)
    real = RealRobot(ros) if solver == LEADING else None
    rate = "ik_hz:=50" if real is None else "ik_hz:=100"  # the driver of the real robot wants a smooth motion
    arguments = (f"ik:={solver}", rate, "headless:=true", f"real_robot:={real is not None}")
    process = ros.start(["roslaunch", "rpbi_examples", "kuka_lwr_ik_example.launch", *arguments])

    def places():
        """Returns where target and tip have been in the world since the target moves [m]; shapes (n, 3)."""
        assert process.poll() is None, ros.output(process)
        figure = poses(still, FIGURE)[1]
        (stamps_s, target), (tip_stamps_s, tip) = poses(moving, TARGET), poses(moving, TIP)
        goes = np.linalg.norm(target[:, :3, 3], axis=1) > 1e-3
        if not len(figure) or not goes.any():
            return None
        since_s = stamps_s[goes.argmax()]
        return moved(target[goes, :3, 3], figure[0]), tip[tip_stamps_s >= since_s, :3, 3]

    def drawn():
        found = places()
        return found and min(np.ptp(each[:, 1]) if len(each) else 0.0 for each in found) > SPAN_M and found

    if real is not None:
        real.wait_until_moved()
    target, tip = wait_until(drawn, "target and tip move from end to end", 300.0, every_s=1.0)
    off_m = np.linalg.norm(tip[:, None] - target[None], axis=-1).min(axis=1)
    assert np.median(off_m) < NEAR_M
    assert rosgraph.Master("/tests").lookupService(f"/ik/solver/{solver}/solve")
