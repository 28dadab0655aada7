"""`primitives_node.py`: recorded, learned, planned, executed, saved and loaded."""

from __future__ import annotations

import itertools
import re
import shlex
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rosbag
import rospy
import rosservice
from cob_srvs.srv import SetString
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from node_world import publishing
from ros_system import wait_until
from sensor_msgs.msg import JointState
from shown_motions import reach
from std_msgs.msg import Float64MultiArray, Header
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage

from motion_primitives import Demonstration
from motion_primitives.msg import PrimitiveState
from motion_primitives.msg import ViaPoint as ViaPointMessage
from motion_primitives.srv import PlanPrimitive

PAGE = (Path(__file__).resolve().parents[3] / "docs/learning.md").read_text()
SHOWN = reach(duration_s=1.0, samples=101)
GOAL = [0.3, 0.4, 0.5, 0.0, 0.0, 0.6, 0.8]


def start(ros, **config):
    rospy.set_param("/primitives_node/config", config)
    ros.start(["rosrun", "motion_primitives", "primitives_node.py"])
    states = ros.listen("primitive/state", PrimitiveState)
    states.wait_for(1)
    return states


def trigger(ros, name):
    answer = ros.call(f"primitive/{name}", Trigger)
    return answer.success, answer.message


def string(ros, name, data):
    answer = ros.call(f"primitive/{name}", SetString, data)
    return answer.success, answer.message


@pytest.fixture
def of_page(capsys, monkeypatch):
    """Returns what the next command of docs/learning.md for a service prints, in the order of the page."""
    (block,) = re.findall(r"```console\n(\$ rosservice .*?)```", PAGE, re.DOTALL)
    commands = iter([line.removeprefix("$ ") for line in block.splitlines() if line.startswith("$ ")])

    def run(service: str) -> str:
        words = shlex.split(next(commands))
        assert words[:3] == ["rosservice", "call", f"/primitive/{service}"]
        with monkeypatch.context() as patched:
            patched.setattr(rospy, "init_node", lambda *_, **__: None)  # this process is a node already
            rosservice.rosservicemain(words)
        return capsys.readouterr().out

    return run


def show(own_tf, shown: Demonstration, record: Callable[[str], str]) -> str:
    """Shows a motion on TF at 100 Hz while the node records, and returns what the end of the record prints."""
    send = lambda point: own_tf.set_tf("world", "hand", point[:3], point[3:])  # noqa: E731
    send(shown.points[0])
    assert "success: True" in record("record")
    for point in shown.points:
        send(point)
        rospy.rostime.wallsleep(0.01)
    return record("record")


def test_a_pose_that_is_shown_live(ros, own_tf, tmp_path, of_page):
    states = start(
        ros,
        primitive={"type": "promp"},
        source={"tf": {"parent": "world", "child": "hand"}},
        output={"tf": {"parent": "world", "child": "target"}, "signal": {"content": "velocity"}},
        coupling={"force_stiffness": 100.0, "obstacles": [{"frame_id": "ball"}]},
        bounds={"x": [-1.0, 1.0]},
        folder=str(tmp_path / "primitives"),
    )
    assert trigger(ros, "learn") == (False, "demonstrations: expected at least one, got none")
    assert "learned nothing yet" in ros.call("primitive/plan", PlanPrimitive).message
    assert 'success: True\nmessage: "demonstration 1 of ' in show(own_tf, SHOWN, of_page)
    assert 'success: True\nmessage: "learned from 1 demonstrations"' in of_page("learn")

    # a plan from where the hand is
    answer = ros.call("primitive/plan", PlanPrimitive, goal=GOAL, duration=3.0)
    assert answer.success, answer.message
    assert answer.trajectory.joint_names == ["x", "y", "z", "qx", "qy", "qz", "qw"]
    first, last = answer.trajectory.points[0], answer.trajectory.points[-1]
    assert first.positions[:3] == pytest.approx(SHOWN.points[-1][:3], abs=1e-3)
    assert last.positions[:3] == pytest.approx(GOAL[:3], abs=1e-3)
    assert last.time_from_start.to_sec() == pytest.approx(3.0)
    via = [ViaPointMessage(0.5, [0.5, 0.5, 0.5, 0.0, 0.0, 0.0, 1.0])]
    middle = ros.call("primitive/plan", PlanPrimitive, goal=GOAL, duration=3.0, via_points=via).trajectory.points[150]
    assert middle.positions[:3] == pytest.approx([0.5, 0.5, 0.5], abs=1e-3)
    for change, text in (
        ({"goal": [1.2, *GOAL[1:]]}, "goal: x: expected positions from -1 to 1, got 1.2"),
        ({"goal": [1.0]}, "goal: expected 7 finite numbers"),
        ({"duration": -1.0}, "duration: expected a finite time"),
        ({"via_points": [ViaPointMessage(2.0, GOAL)]}, r"via_points[0].progress"),
    ):
        answer = ros.call("primitive/execute", PlanPrimitive, **{"goal": GOAL, **change})
        assert not answer.success and text in answer.message

    # executed, with another goal on the way and a push
    signals = ros.listen("primitive/signal", Float64MultiArray)
    target = ros.listen("/tf", TFMessage)
    with (
        publishing("primitive/goal", Float64MultiArray) as goal,
        publishing("primitive/wrench", WrenchStamped) as wrench,
    ):
        assert ros.call("primitive/execute", PlanPrimitive, goal=GOAL, duration=2.0).success
        assert not ros.call("primitive/execute", PlanPrimitive, goal=GOAL).success
        wait_until(lambda: states.messages[-1].elapsed > 0.3, "the motion goes on")
        goal.publish(Float64MultiArray(data=[0.2, 0.2, 0.2, 0.0, 0.0, 0.0, 1.0]))
        wrench.publish(WrenchStamped(wrench=Wrench(force=Vector3(5.0, 0.0, 0.0))))
        end = lambda: states.messages[-1].mode == "executing" and states.messages[-1].elapsed > 2.5  # noqa: E731
        wait_until(end, "the push keeps it from its goal")
        assert states.messages[-1].position[:3] == pytest.approx([0.25, 0.2, 0.2], abs=2e-3)
        wrench.publish(WrenchStamped())
        wait_until(lambda: states.messages[-1].mode == "idle", "it arrives")
    assert states.messages[-1].message == "goal reached"
    assert signals.messages[-1].data == (0.0,) * 6
    frames = [each for message in target.messages for each in message.transforms if each.child_frame_id == "target"]
    translation = frames[-1].transform.translation
    assert (translation.x, translation.y, translation.z) == pytest.approx((0.2, 0.2, 0.2), abs=1e-3)

    # saved, and read again
    assert string(ros, "save", "wave")[0] and (tmp_path / "primitives/wave.yaml").exists()
    assert string(ros, "load", "wave")[0]
    assert not string(ros, "save", "../wave")[0]
    assert string(ros, "load", "none") == (False, f"{tmp_path}/primitives/none.yaml: no such file or directory")
    text = (tmp_path / "primitives/wave.yaml").read_text().replace("type: promp", "type: 'this:Zen'")
    (tmp_path / "primitives/bad.yaml").write_text(text)
    success, message = string(ros, "load", "bad")
    assert not success and "'this:Zen' is not trusted" in message
    assert "success: True" in of_page("execute")
    assert trigger(ros, "stop") == (True, "stopped") and trigger(ros, "stop")[0] is False


def test_joints_of_a_bag_and_live(ros, tmp_path):
    times = np.linspace(1.0, 3.0, 201)
    share = np.sin(np.linspace(0.0, 0.5 * np.pi, 201)) ** 2
    path = tmp_path / "shown.bag"
    with rosbag.Bag(str(path), "w") as bag:
        for t, u in zip(times.tolist(), share.tolist()):
            stamp = rospy.Time.from_sec(t)
            bag.write("/joint_states", JointState(Header(stamp=stamp), ["b", "a"], [u, -u], [], []), stamp)
    states = start(ros, source={"joints": {"names": ["a", "b"]}}, output={"joints": {}}, hz=200.0)
    success, message = string(ros, "add_bag", str(path))
    assert success and message == "demonstration 1 of 2.00 s and 201 samples is stored"
    assert "such file" in string(ros, "add_bag", "/none.bag")[1]
    assert string(ros, "add_bag", "/etc/passwd")[1].startswith("data: expected the path of a file NAME.bag")
    assert trigger(ros, "learn")[0] and states.messages[-1].demonstrations == 1
    targets = ros.listen("joint_states/target", JointState)
    with publishing("joint_states", JointState) as measured:
        stopped = threading.Event()

        def measure():
            begin = rospy.Time.now()
            for count in itertools.count():  # stamps keep their distance on a busy machine, too
                stamp = begin + rospy.Duration(0.01 * count)
                measured.publish(JointState(Header(stamp=stamp), ["b", "a"], [0.5, 0.1], [], []))
                if stopped.wait(0.01):
                    break

        thread = threading.Thread(target=measure)
        thread.start()
        begins_there = lambda: (  # noqa: E731
            ros.call("primitive/plan", PlanPrimitive).trajectory.points[0].positions == (0.1, 0.5)
        )
        wait_until(begins_there, "a plan begins where the joints are")
        assert ros.call("primitive/execute", PlanPrimitive, goal=[1.0, 2.0], duration=1.0).success
        wait_until(lambda: states.messages[-1].message == "goal reached", "it arrives")
        assert ros.call("primitive/record", SetBool, True).success
        wait_until(lambda: states.messages[-1].elapsed > 0.5, "it records")
        assert ros.call("primitive/record", SetBool, False).message.startswith("demonstration 2 of ")
        stopped.set()
        thread.join()
    assert targets.messages[0].name == ["a", "b"]
    assert targets.messages[0].position == pytest.approx((0.1, 0.5), abs=0.02)
    assert targets.messages[-1].position == pytest.approx((1.0, 2.0), abs=1e-3)
    assert max(np.abs(np.diff([each.position for each in targets.messages], axis=0)).max(axis=0)) < 0.4
    assert trigger(ros, "discard") == (True, "1 demonstrations are left")


def test_a_wrong_configuration_ends_the_node(ros):
    config = {"source": {"joints": {"names": ["a"]}}, "output": {"tf": {"parent": "a", "child": "b"}}, "rate": 3}
    rospy.set_param("/primitives_node/config", config)
    process = ros.start(["rosrun", "motion_primitives", "primitives_node.py"])
    assert process.wait(60) == 1
    assert "~config: rate: unknown key 'rate'" in ros.output(process)
