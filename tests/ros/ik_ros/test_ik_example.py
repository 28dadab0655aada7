"""`kuka_lwr_ik_example.launch`: the arm tracks a figure eight by each solver, headless."""

from __future__ import annotations

import math

import pytest
import rosgraph
import rospy
import tf2_ros
from ros_system import wait_until

TIP, TARGET = "rpbi/kuka_lwr/end_effector_ball", "rpbi/figure_eight"
SOLVERS = ("kdl", "pybullet", "trac_ik", "tasks", "global", "trajectory")  # the last one plans the figure as a whole
SLOWLY = "real_time_factor:=0.3"  # so that a busy machine does not count
NEAR_M = 0.03
"""How far the tip may lag behind [m]."""


@pytest.mark.parametrize("solver", SOLVERS)
def test_arm_tracks_the_figure(ros, request, solver):
    process = ros.start(
        ["roslaunch", "rpbi_examples", "kuka_lwr_ik_example.launch", f"ik:={solver}", "headless:=true", SLOWLY]
    )
    buffer = tf2_ros.Buffer(debug=False)
    listener = tf2_ros.TransformListener(buffer)
    request.addfinalizer(listener.unregister)

    def position(frame):
        try:
            found = buffer.lookup_transform("rpbi/world", frame, rospy.Time(0)).transform.translation
        except tf2_ros.TransformException:
            return None
        return found.x, found.y, found.z

    places = []

    def has_drawn_half():
        assert process.poll() is None, ros.output(process)
        target, tip = position(TARGET), position(TIP)
        if target and tip and math.dist(target, (-0.2, 0.0, 0.6)) > 1e-3:
            places.append((target, math.dist(target, tip)))
        return places and max(place[1] for place, _ in places) - min(place[1] for place, _ in places) > 0.35

    wait_until(has_drawn_half, "the figure moves from end to end", 120.0)
    distances = sorted(distance for _, distance in places)
    assert distances[len(distances) // 2] < NEAR_M
    assert rosgraph.Master("/tests").lookupService(f"/ik/solver/{solver}/solve")
