"""`telepresence.launch` dresses somebody; messages to `telepresence_node.py` that make no sense are refused by name."""

from __future__ import annotations

import json
from typing import Any

import pytest
import rosnode
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3, Wrench
from node_world import Rosout, publishing
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from visualization_msgs.msg import Marker, MarkerArray
from workplace import Port

from operator_node.msg import SegmentForces
from ros_pybullet_interface.srv import ApplyWrench, ResetJointState
from rpbi_utils.msg import DriverState
from safe_robot.msg import Violation

JOINTS = [f"panda_joint{number}" for number in range(1, 8)] + ["panda_finger_joint1", "panda_finger_joint2"]
SLOW_S = 180.0
ARM = ["RightShoulder", "RightUpperArm", "RightForeArm", "RightHand"]
BAD = (
    ("/rpbi/panda/joint_states", JointState(name=JOINTS[:3], position=[0.0] * 3), "panda_joint4"),
    ("/rpbi/panda/joint_states", JointState(name=JOINTS), "expected positions of the joints, got none"),
    ("/avatar/segment_forces", SegmentForces(segments=ARM[1:], sums=[0] * 3, largest=[0] * 3), "without RightShoulder"),
    ("/rpbi/sleeve/surface", Marker(points=[Point()] * 4), "expected the 308 triangles of the sleeve"),
)


def test_bad_messages_are_refused_by_name_and_the_node_continues(ros):
    rosout = Rosout(ros)
    process = ros.start(["rosrun", "rpbi_examples", "telepresence_node.py"])
    rosout.wait_to_hear("/telepresence")
    wait_until(lambda: "waiting for the person" in ros.output(process), "it runs")

    def refuses(topic: str, message: Any, why: str) -> None:
        with publishing(topic, type(message)) as publisher:
            wait_until(
                lambda: (
                    publisher.publish(message)
                    or [log for log in rosout.logs(f"{topic}: message refused: ") if why in log.msg]
                ),
                f"{topic} is refused: {why}",
            )

    for case in BAD:
        refuses(*case)
    assert process.poll() is None
    assert "Traceback" not in ros.output(process)


@pytest.mark.thorough
def test_person_is_dressed_from_suit_datagrams_to_the_outcome(ros, tmp_path):
    """Faster than people would like, so that the test is short; a slow simulator is a slow robot."""
    out = tmp_path / "outcome.json"
    arguments = ["headless:=true", "speed:=0.35", f"out:={out}", f"port:={Port().number}"]
    process = ros.start(["roslaunch", "rpbi_examples", "telepresence.launch", *arguments])
    wait_until(lambda: "the sleeve is" in ros.output(process), "somebody is dressed", SLOW_S)
    wait_until(lambda: out.exists() and out.read_text().endswith("}\n"), "the outcome is written")
    outcome = json.loads(out.read_text())
    assert outcome["is_dressed"] and outcome["past_elbow_m"] > 0.05
    assert 0.0 < outcome["peak_force_n"] < 15.0 and outcome["peak_share"] < 1.0
    assert "Traceback" not in ros.output(process)


@pytest.mark.alone
@pytest.mark.thorough
@pytest.mark.parametrize("guard", [True, False])
def test_guard_keeps_the_real_robot_off_live_bodies(ros, guard):
    """These are the segments of the person, and what else is there; the robot's own forces have a limit, too."""
    violations = ros.listen("/real_robot/robot_safety/violation", Violation)
    driver = ros.listen("/stand_in/driver_state", DriverState)
    commands = ros.listen("/stand_in/joint_group_position_controller/command", Float64MultiArray)
    arguments = ["headless:=true", "real_robot:=true", f"guard:={str(guard).lower()}", f"port:={Port().number}"]
    process = ros.start(["roslaunch", "rpbi_examples", "telepresence.launch", *arguments])
    wait_until(lambda: "drawing the sleeve" in ros.output(process), "the person holds out an arm", SLOW_S)
    if guard:
        assert driver.messages[-1].mode == DriverState.MOVE, driver.messages[-1].message
    rosnode.kill_nodes(["/telepresence"])

    def move(position: float) -> None:
        goal = JointState(name=["panda_joint1"], position=[position])
        ros.call("/rpbi/panda/move_to_joint_state", ResetJointState, goal, 2.0)

    def farthest() -> float:
        """Returns how far towards the ball the driver was commanded to turn the first joint [rad]."""
        return min(each.data[0] for each in list(commands.messages))

    def is_rejected(check: str, subject: str) -> bool:
        return any(check == each.check and subject in each.subject for each in list(violations.messages))

    ball = Marker(ns="ball", type=Marker.SPHERE, pose=Pose(Point(0.98, -0.65, 1.43), Quaternion(0.0, 0.0, 0.0, 1.0)))
    ball.header.frame_id, ball.scale = "rpbi/world", Vector3(0.15, 0.15, 0.15)
    if not guard:
        move(-0.6)
        wait_until(lambda: farthest() < -0.55, "the driver is sent to where the ball would be", SLOW_S)
        return
    with publishing("/rpbi/markers", MarkerArray) as markers:
        markers.publish([ball])
        move(-0.6)
        wait_until(lambda: is_rejected("environment", "'ball'"), "the ball is in the way", SLOW_S)
        move(0.5)
    assert farthest() > -0.45
    wait_until(lambda: is_rejected("environment", "'human'"), "the person is in the way", SLOW_S)
    push = Wrench(force=Vector3(0.0, 0.0, -90.0))
    assert ros.call("/stand_in/rpbi/apply_wrench", ApplyWrench, "panda/panda_hand", push, Point(), "world", 0.0).success
    wait_until(lambda: is_rejected("force", ""), "the robot feels more than it may", SLOW_S)
