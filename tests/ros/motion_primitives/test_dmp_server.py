"""The release's node, services and Python modules of movement primitives."""

from __future__ import annotations

import numpy as np
import pytest
import rospy
from dmp.msg import DMPData, DMPPoint, DMPTraj
from dmp.srv import GetDMPPlan, LearnDMPFromDemo, SetActiveDMP
from ros_system import wait_until

TIMES = np.linspace(0.0, 2.0, 51)
SHARE = 10 * (TIMES / 2) ** 3 - 15 * (TIMES / 2) ** 4 + 6 * (TIMES / 2) ** 5
PATH = np.stack([SHARE, -0.5 * SHARE])


def test_an_old_client_learns_and_plans(ros, own_tf):
    from dmp.data_collector import TFPositionDMPDataCollector
    from dmp.dmp_proc import DMPProcessor

    ros.start(["roslaunch", "--wait", "dmp", "dmp.launch"])
    collector = TFPositionDMPDataCollector("world", "tip", hz=200, collect_z=False, interpolate=50)
    assert collector.is_empty()
    wait_until(lambda: own_tf.set_tf("world", "tip", [9, 9, 9]) or own_tf.get_tf_msg("world", "tip"), "TF arrives")
    assert collector.is_empty(), "it records only while it is on"
    collector.start()
    for x, y in PATH.T:
        own_tf.set_tf("world", "tip", [x, y, 0.0])
        rospy.rostime.wallsleep(0.02)
    collector.stop()
    times, path = collector.get()
    assert times[0] == 0.0 and 0.9 < times[-1] < 20.0 and path.shape == (2, 50)
    assert collector.get_last() == pytest.approx([1.0, -0.5], abs=0.02)

    processor = DMPProcessor()
    dmp = processor.learn_dmp(TIMES, PATH, 100, 20, 4)
    assert dmp.tau == 2.0 and len(dmp.dmp_list) == 2 and len(dmp.dmp_list[0].weights) == 4
    arguments = ([0.1, 0.1], [0.0, 0.0], 0, [0.5, 0.5], [0.03, 0.03], -1, 2.0 * dmp.tau, 0.02, 5)
    success, t, positions, velocities = processor.generate_plan(dmp, *arguments)
    assert success and t[0] == pytest.approx(0.02) and t[-1] >= 4.0
    assert positions.shape == velocities.shape == (2, len(t))
    assert positions[:, -1] == pytest.approx([0.5, 0.5], abs=0.03)
    assert processor.learn_dmp(TIMES[:2], PATH[:, :2], 100, 20, 4) is None
    assert processor.generate_plan(dmp, *arguments[:-2], 0.0, 5) == (False, None, None, None)

    # a request that makes no sense is answered by an error, and what is active stays
    learn = rospy.ServiceProxy("learn_dmp_from_demo", LearnDMPFromDemo)
    ragged = DMPTraj([DMPPoint(positions=[0.0] * n) for n in (2, 1, 2)], [0.0, 1.0, 2.0])
    with pytest.raises(rospy.ServiceException, match="positions: expected as many in each point"):
        learn(ragged, [100.0] * 2, [20.0] * 2, 4)
    set_active = rospy.ServiceProxy("set_active_dmp", SetActiveDMP)
    assert not set_active([DMPData(k_gain=0.0)]).success
    plan = rospy.ServiceProxy("get_dmp_plan", GetDMPPlan)
    with pytest.raises(rospy.ServiceException, match="x_0: expected 2 finite numbers"):
        plan(x_0=[0.0], x_dot_0=[0.0], goal=[0.0], goal_thresh=[0.0], tau=1.0, dt=0.1, integrate_iter=1, seg_length=-1)
    assert plan(*arguments).at_goal == 1
