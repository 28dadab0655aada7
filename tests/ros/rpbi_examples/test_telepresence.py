"""`telepresence_node.py`: messages that make no sense are refused, and the reason is named."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import Point
from node_world import Rosout, publishing
from ros_system import wait_until
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker

from operator_node.msg import SegmentForces

JOINTS = [f"panda_joint{number}" for number in range(1, 8)] + ["panda_finger_joint1", "panda_finger_joint2"]
ARM = ["RightShoulder", "RightUpperArm", "RightForeArm", "RightHand"]
BAD = (
    ("/rpbi/panda/joint_states", JointState(name=JOINTS[:3], position=[0.0] * 3), "panda_joint4"),
    ("/rpbi/panda/joint_states", JointState(name=JOINTS), "expected positions of the joints, got none"),
    ("/avatar/segment_forces", SegmentForces(segments=ARM[1:], sums=[0] * 3, largest=[0] * 3), "without RightShoulder"),
    ("/rpbi/sleeve/surface", Marker(points=[Point()] * 4), "expected the 308 triangles of the sleeve"),
)


def test_bad_messages_are_refused_by_name_and_the_node_goes_on(ros):
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
