"""`telepresence.launch` dresses somebody; messages to `telepresence_node.py` that make no sense are refused by name."""

from __future__ import annotations

import json
from typing import Any

from geometry_msgs.msg import Point
from node_world import Rosout, publishing
from ros_system import wait_until
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker
from workplace import Port

from operator_node.msg import SegmentForces

JOINTS = [f"panda_joint{number}" for number in range(1, 8)] + ["panda_finger_joint1", "panda_finger_joint2"]
SLOW_S = 180.0
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


def test_a_person_is_dressed_from_datagrams_of_a_suit_to_the_outcome(ros, tmp_path):
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
