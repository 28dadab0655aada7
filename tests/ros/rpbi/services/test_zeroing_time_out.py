"""A force-torque sensor whose samples come too slowly: the service that zeroes it ends with a reason."""

from __future__ import annotations

import sys

import pytest
import rospy
from node_world import main_config
from ros_system import wait_until
from std_srvs.srv import Empty, Trigger
from worlds import iiwa

from ros_pybullet_interface.srv import SetSensorRate

JOINT = "lbr_iiwa_joint_7"
NODE = """
from rpbi.ros import node
from rpbi.ros.services import body_endpoints
body_endpoints.LONGEST_ZEROING_S = 0.5
node.main()
"""


def test_zeroing_that_times_out_can_be_requested_again(ros, tmp_path):
    sensor = {"joint": JOINT, "hz": 0.01}  # a sample every 100 s
    config = main_config(tmp_path, robots=(iiwa(enabled_joint_force_torque_sensors=[sensor]),))
    rospy.set_param("/ros_pybullet_interface/config", config)
    ros.start([sys.executable, "-c", NODE])
    ros.call("/rpbi/start", Trigger)
    topic = f"/rpbi/iiwa/{JOINT}/ft_sensor"
    with pytest.raises(rospy.ServiceException, match=r"not 100 samples within 0.5 s: .* 0.01 Hz .*old zero stays"):
        ros.call(topic, Empty)
    assert ros.call("/rpbi/set_sensor_rate", SetSensorRate, f"iiwa/{JOINT}/ft_sensor", 1000.0).success

    def is_zeroed():
        try:
            return ros.call(topic, Empty) is not None
        except rospy.ServiceException:  # on a busy machine
            return False

    wait_until(is_zeroed, "it works with samples that come fast enough")
