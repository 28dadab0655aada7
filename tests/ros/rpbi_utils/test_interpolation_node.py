"""`interpolation_node.py`: targets of joints and frames in ROS time, pauses, repetitions and what is rejected."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import rospy
from node_world import Rosout, publishing
from ros_system import RosSystem, wait_until
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

TOPIC = "ros_pybullet_interface/waypt_traj"
FLAG = "/stream_interpolated_motion_flag"


def message(rows: Any) -> Float64MultiArray:
    rows = np.array(rows, dtype=float)
    dimensions = [MultiArrayDimension("rows", rows.shape[0], 0), MultiArrayDimension("columns", rows.shape[1], 0)]
    return Float64MultiArray(MultiArrayLayout(dimensions, 0), rows.ravel().tolist())


def start(ros: RosSystem, config: dict[str, Any], **parameters: Any) -> Any:
    file = ros.write_yaml("traj.yaml", config)
    words = [f"_{key}:={value}" for key, value in {"traj_config": file, **parameters}.items()]
    return ros.start(["rosrun", "rpbi_utils", "interpolation_node.py", "__name:=interpolation", *words])


JOINTS = {"motion_dimensions": {"number": 2, "joint_names": ["a", "b"]}, "interpolation": {"inter_dt": 0.02}}
FRAME = {
    "motion_dimensions": {
        "number": 1,
        "trans": {"translation_x_index": 0, "translation_y": 2.0, "translation_z": 3.0},
        "rotation": {"rotation_repr": "none", "rotation_vec": [0, 0, 1], "rotation_angle": 90.0},
    },
    "communication": {"publisher": {"header_frame_id": "world", "msg_child_frame_id": "target"}},
}
LINE = [[0, 1], [0, 1], [0, -2], [1, 1], [-2, -2]]
"""Joints at the time and at -2 times the time."""


class Motion:
    """The targets of joints so far."""

    def __init__(self, ros: RosSystem) -> None:
        self._targets = ros.listen("joint_states/target", JointState)
        wait_until(lambda: self._targets.is_connected, "the node sends its targets to us")

    def __call__(self) -> list[JointState]:
        return list(self._targets.messages)

    def wait_until_over(self, goal: float) -> list[JointState]:
        wait_until(lambda: self()[-1].position[0] == pytest.approx(goal), f"joint a is at {goal}")
        return self()


@pytest.mark.thorough
def test_joints_pause_repetitions_and_bad_waypoints(ros):
    """In wall time: one life with four motions."""
    start(ros, JOINTS)
    motion, rosout = Motion(ros), Rosout(ros)
    rosout.wait_to_hear("/interpolation")
    with publishing(TOPIC, Float64MultiArray) as waypoints:
        waypoints.publish(message(LINE))
        got = motion.wait_until_over(1.0)
        first_s = got[0].header.stamp.to_sec()
        for each in got:
            time_s = each.header.stamp.to_sec() - first_s
            assert each.name == ["a", "b"]
            assert each.position == pytest.approx((time_s, -2.0 * time_s), abs=1e-6)
            assert each.velocity == pytest.approx((1.0, -2.0) if time_s < 0.999 else (0.0, 0.0))
        steps = np.diff([each.header.stamp.to_sec() for each in got])
        assert np.round(steps / 0.02) * 0.02 == pytest.approx(steps, abs=1e-6), "samples are on their grid"

        waypoints.publish(message(LINE))  # a client of the release repeats its message twice a second
        for rows, expected in (
            (np.full((5, 2), math.nan), "data: expected finite numbers, got nan in row 0, column 0"),
            (np.zeros((4, 2)), "layout.dim: expected 3, 5 or 7 rows for motion_dimensions.number 2"),
        ):
            rospy.sleep(5.1 if "rows" in expected else 0.0)  # warnings are throttled
            waypoints.publish(message(rows))
            rosout.wait_for([f"/{TOPIC}: waypoints rejected: {expected}"])
        assert len(motion()) == len(got), "neither a repetition nor wrong waypoints move anything"

        rospy.set_param(FLAG, False)
        rospy.sleep(0.5)
        waypoints.publish(message([[0, 1], [1, 3], [-2, 0]]))
        rospy.sleep(0.5)
        assert len(motion()) == len(got), "paused"
        rospy.set_param(FLAG, True)
        again = motion.wait_until_over(3.0)[len(got) :]
        assert again[0].position[0] == pytest.approx(1.0, abs=0.05)

        assert ros.call("interpolation/reset", Trigger).success
        waypoints.publish(message(LINE))
        wait_until(lambda: len(motion()) > len(got) + len(again), "it moves again")
        assert motion()[len(got) + len(again)].position[0] == pytest.approx(0.0, abs=0.05), "from the first waypoint"


JOINT = (
    '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{0}_link"/><axis xyz="0 0 1"/>'
    '<limit effort="1" velocity="1.5"/></joint><link name="{0}_link"/>'
)
ROBOT = f'<robot name="r"><link name="base"/>{JOINT.format("a", "base")}{JOINT.format("b", "a_link")}</robot>'


def test_joints_keep_the_speeds_of_robot_description(ros):
    rospy.set_param("robot_description", ROBOT)
    start(ros, JOINTS)
    motion, rosout = Motion(ros), Rosout(ros)
    rosout.wait_to_hear("/interpolation")
    with publishing(TOPIC, Float64MultiArray) as waypoints:
        waypoints.publish(message([[0, 1], [0, 1], [0, -2]]))  # joint b would reach 3 rad/s
        got = motion.wait_until_over(1.0)
    assert max(abs(each.velocity[1]) for each in got) == pytest.approx(1.5, rel=0.01)
    assert (got[-1].header.stamp - got[0].header.stamp).to_sec() == pytest.approx(2.0, abs=0.01)
    slowed = (
        "(limits): the motion takes 2 times as long, to keep interpolation.limits: as sent it has velocity of row 1 3"
    )
    rosout.wait_for([slowed, "interpolation.limits: there is no limit for acceleration 2.99 "])


def test_a_frame_follows_simulated_time_at_any_rate(ros):
    """Time stands still, runs fast, and jumps back; the rate of ticks is lower than that of samples."""
    rospy.set_param("/use_sim_time", True)
    start(ros, FRAME, consuming_freq=25.0, namespace="robot")
    tf, rosout = ros.listen("/tf", TFMessage), Rosout(ros)

    def poses() -> list[Any]:
        return [each for one in list(tf.messages) for each in one.transforms]

    with publishing("/clock", Clock) as clock, publishing(TOPIC, Float64MultiArray) as waypoints:
        waypoints.publish(message([[0, 10], [0, 10], [1, 1]]))  # before there is any time
        rospy.rostime.wallsleep(0.5)
        assert not poses()

        def run(start_s: float, end_s: float) -> None:
            for now_s in np.arange(start_s, end_s, 0.01):
                clock.publish(Clock(rospy.Time.from_sec(now_s)))
                rospy.rostime.wallsleep(0.002)

        run(1000.0, 1004.0)
        counts = [0]
        wait_until(lambda: counts.append(len(poses())) or counts[-1] == counts[-2], "it stands still", every_s=0.3)
        assert counts[-1] > 50
        run(1004.0, 1011.0)
        wait_until(lambda: poses()[-1].transform.translation.x == pytest.approx(10.0), "it has arrived")
        start_s = poses()[0].header.stamp.to_sec()
        for each in poses():
            assert (each.header.frame_id, each.child_frame_id) == ("world", "robot/target")
            p, q = each.transform.translation, each.transform.rotation
            assert (p.x, p.y, p.z) == pytest.approx((each.header.stamp.to_sec() - start_s, 2.0, 3.0), abs=1e-6)
            assert (q.z, q.w) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))
        steps = np.diff([each.header.stamp.to_sec() for each in poses()])
        assert np.median(steps) == pytest.approx(0.04, abs=0.0101)

        count = len(poses())
        run(5.0, 6.0)
        rosout.wait_for(["ROS time went back by"])
        waypoints.publish(message([[0, 1], [5, 6]]))
        run(6.0, 8.0)
        wait_until(lambda: poses()[-1].transform.translation.x == pytest.approx(6.0), "it moves in the new time")
        assert poses()[count].header.stamp.to_sec() < 10.0


@pytest.mark.parametrize(
    ("config", "parameters", "expected"),
    [
        (JOINTS, {"consuming_freq": 250.0}, "consuming_freq"),
        (JOINTS, {"traj_config": "/nowhere.yaml"}, "/nowhere.yaml: no such file"),
        ({**JOINTS, "interpolation": {"inter_dT": 0.1}}, {}, "traj.yaml: interpolation.inter_dT: unknown key"),
    ],
)
def test_a_wrong_configuration_ends_it_with_a_line(ros, config, parameters, expected):
    process = start(ros, config, **parameters)
    assert process.wait(60.0) == 1
    output = ros.output(process)
    assert expected in output and "Traceback" not in output, output
