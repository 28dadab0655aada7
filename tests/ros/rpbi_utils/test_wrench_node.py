"""`calibrate_wrench_node.py` beside a simulated KUKA: zero, a payload from a few poses, and refusal while it moves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import InertiaStamped, Vector3, WrenchStamped
from node_world import Rosout, main_config, publishing
from ros_system import RosSystem, wait_until
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from ros_pybullet_interface.srv import ResetJointState

HOME = {"lwr_arm_1_joint": 0.52, "lwr_arm_3_joint": -1.57, "lwr_arm_5_joint": 1.05}
POSES = ({"lwr_arm_5_joint": 0.3}, {"lwr_arm_5_joint": 1.6, "lwr_arm_4_joint": 0.8}, {"lwr_arm_4_joint": -1.2})
TOOL_KG = 0.25 + 0.12 + 0.03 + 0.02
"""Mass of what hangs on the sensor, by the URDF."""
SENSOR = "force_torque_sensor_mount"
READING = f"rpbi/arm/{SENSOR}/ft_sensor"


def arm(ros: RosSystem) -> dict[str, Any]:
    robot = {
        "name": "arm",
        "loadURDF": {"fileName": "{rpbi_examples}/robots/kuka_lwr.urdf", "useFixedBase": True},
        "setJointMotorControlArray": {"controlMode": "POSITION_CONTROL"},
        "initial_joint_position": HOME,
        "initial_revolute_joint_positions_are_deg": False,
        "broadcast_link_states": True,
        "broadcast_link_states_hz": 100,
        "enabled_joint_force_torque_sensors": [
            {"joint": SENSOR, "hz": 200, "noise_force_n": 0.05, "noise_torque_nm": 0.002, "bias_force_n": [1, 2, 3]}
        ],
    }
    return main_config(ros.folder, robots=(robot,), timeStep=0.002)


@pytest.fixture
def node(ros: RosSystem) -> Iterator[RosSystem]:
    ros.simulator(arm(ros), use_sim_time=True)
    rospy.set_param("/use_sim_time", True)
    clock = ros.listen("/clock", Clock)
    wait_until(lambda: clock.messages[-1].clock.to_sec() > 1.0, "the arm has settled")
    words = ["__name:=calibrate", f"wrench:={READING}", "wrench/calibrated:=calibrated"]
    ros.start(["rosrun", "rpbi_utils", "calibrate_wrench_node.py", *words])
    yield ros


def go(ros: RosSystem, duration: float = 1.0, **joints: float) -> None:
    target = {**HOME, **joints}
    state = JointState(name=list(target), position=list(target.values()))
    assert ros.call("rpbi/arm/move_to_joint_state", ResetJointState, state, duration).success


def vector(message: WrenchStamped) -> np.ndarray:
    return np.array([getattr(part, axis) for part in (message.wrench.force, message.wrench.torque) for axis in "xyz"])


@pytest.mark.thorough
def test_payload_is_identified_and_its_weight_subtracted_in_every_pose(node):
    read, payload = node.listen("calibrated", WrenchStamped), node.listen("wrench/payload", InertiaStamped)
    rosout = Rosout(node)

    def now() -> np.ndarray:
        """Returns the mean of the next 50 wrenches."""
        count = len(read.messages)
        return np.mean([vector(each) for each in read.wait_for(count + 50)[count:]], axis=0)

    read.wait_for(1)
    assert np.abs(now()).max() < 0.05, "zero where it stands"
    assert read.messages[-1].header.frame_id == "rpbi/arm/force_torque_sensor"

    assert "expected at least 3 poses, got 0" in node.call("wrench/payload/identify", Trigger).message
    for pose in POSES:
        go(node, **pose)
        answer = node.call("wrench/payload/sample", Trigger)
        assert answer.success, answer.message
    assert np.abs(now()).max() > 0.5, "one zero does not do for another pose"
    answer = node.call("wrench/payload/identify", Trigger)
    assert answer.success and "residual" in answer.message, answer.message
    (found,) = payload.wait_for(1)
    assert found.inertia.m == pytest.approx(TOOL_KG, rel=0.01)
    assert rospy.get_param("/calibrate/identified_payload/mass") == pytest.approx(TOOL_KG, rel=0.01)
    for pose in ({}, {"lwr_arm_5_joint": -0.2, "lwr_arm_4_joint": 0.5}):
        go(node, **pose)
        assert np.abs(now()[:3]).max() < 0.05 and np.abs(now()[3:]).max() < 0.005
    assert rosout.logs("payload: mass 0.4")

    # while it turns slowly, neither zero nor pose are taken and all stays as it was; then it rests, and both are
    states = node.listen("rpbi/arm/joint_states", JointState)

    def joint() -> float:
        state = states.messages[-1]
        return float(state.position[state.name.index("lwr_arm_5_joint")])

    states.wait_for(1)
    start = joint()
    with ThreadPoolExecutor(1) as pool:
        turning = pool.submit(go, node, 4.0, lwr_arm_5_joint=start + 0.4)
        wait_until(lambda: joint() > start + 0.02, "it turns")
        for service in ("wrench/zero", "wrench/payload/sample"):
            answer = node.call(service, Trigger)
            assert not answer.success, answer.message
            assert "the sensor turns" in answer.message or "the sensor moves" in answer.message, answer.message
        turning.result()
    go(node)
    assert np.abs(now()).max() < 0.05
    for service in ("wrench/zero", "wrench/payload/sample"):
        assert node.call(service, Trigger).success
    assert node.call("wrench/payload/clear", Trigger).message == "4 poses removed"


def test_node_without_tf_works_as_in_the_release(ros):
    """Means of `max_samples` messages, all others published; frames are needed for a payload only."""
    rospy.set_param("/calibrate/max_samples", 20)
    ros.start(["rosrun", "rpbi_utils", "calibrate_wrench_node.py", "__name:=calibrate"])
    read, rosout = ros.listen("wrench/calibrated", WrenchStamped), Rosout(ros)
    rosout.wait_to_hear("/calibrate")
    with publishing("wrench", WrenchStamped) as wrench:

        def send(*forces: float) -> None:
            for z in forces:
                message = WrenchStamped()
                message.wrench.force, message.header.frame_id = Vector3(1.0, 2.0, z), "/sensor"
                wrench.publish(message)
                rospy.rostime.wallsleep(0.002)

        def send_until(logged: str, forces: Sequence[float]) -> None:
            """Sends forces again and again: the node may begin a mean at any of them."""

            def is_logged() -> bool:
                send(*forces)
                return bool(rosout.logs(logged))

            wait_until(is_logged, f"/rosout has '{logged}'")

        send_until("not zeroed: the force changes: expected a spread of 1 N at most, got", np.linspace(0.0, 50.0, 20))
        assert not read.messages, "there is no zero yet"
        send_until("zero is 1.000, 2.000, 5.000 N", [5.0] * 20)
        send(6.0, math.nan, 7.5)
        wait_until(lambda: vector(read.messages[-1])[2] == pytest.approx(2.5), "the last one is published")
        *before, second, _ = (vector(each)[2] for each in read.messages)
        assert second == pytest.approx(1.0)
        assert before == pytest.approx([0.0] * len(before)), "nothing is published without its zero"
        rosout.wait_for(["/wrench: left out: expected finite numbers, got 1.000, 2.000, nan"])
        assert "got none for 5 s" in ros.call("wrench/zero", Trigger).message
        assert "expected at least 3 poses" in ros.call("wrench/payload/identify", Trigger).message
