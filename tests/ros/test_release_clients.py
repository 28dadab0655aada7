"""Clients written for the authors' release: in C++, and in Python with the release's keywords."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from node_world import main_config
from release_types import MESSAGES, SERVICES
from ros_system import SUPPORT
from roslaunch import substitution_args
from worlds import iiwa

from ik_ros.lookup import make_solver

PACKAGES = sorted({name.split("/")[0] for name in (*MESSAGES, *SERVICES)} | {"roscpp", "sensor_msgs", "std_srvs"})
CMAKE = f"""cmake_minimum_required(VERSION 3.16)
project(release_client)
find_package(catkin REQUIRED COMPONENTS {" ".join(PACKAGES)})
include_directories(${{CMAKE_CURRENT_SOURCE_DIR}} ${{catkin_INCLUDE_DIRS}})
add_executable(release_client {SUPPORT}/release/release_client.cpp)
target_link_libraries(release_client ${{catkin_LIBRARIES}})
"""


def _header() -> str:
    """Returns what includes each type and hands it to a macro."""
    includes = [f"#include <{name}.h>" for name in (*MESSAGES, *SERVICES)]
    uses = [
        f"  {macro}({name.replace('/', ', ')}) \\"
        for macro, names in (("MESSAGE", MESSAGES), ("SERVICE", SERVICES))
        for name in names
    ]
    return "\n".join((*includes, "#define TYPES(MESSAGE, SERVICE) \\", *uses, "", ""))


@pytest.fixture
def client(tmp_path: Path) -> Path:
    """The program, built as one of a user's package is: with CMake, against this workspace."""
    (tmp_path / "CMakeLists.txt").write_text(CMAKE)
    (tmp_path / "release_types.h").write_text(_header())
    where = {**os.environ, "PATH": "/usr/bin:/bin"}
    for command in (["cmake", "-DPYTHON_EXECUTABLE=/usr/bin/python3", "."], ["make"]):
        done = subprocess.run(command, cwd=tmp_path, env=where, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    return tmp_path / "release_client"


@pytest.mark.thorough
def test_client_in_cpp_knows_all_types_and_is_served(ros, tmp_path, client):
    ros.simulator(main_config(tmp_path, robots=(iiwa(),), setGravity={"gravZ": -9.81}))
    process = ros.start([str(client)])
    assert process.wait(200.0) == 0, ros.output(process)
    lines = ros.output(process).splitlines()
    count = len(MESSAGES) + len(SERVICES)
    assert dict(line.split() for line in lines[:count]) == {**MESSAGES, **SERVICES}
    assert lines[count:] == [
        "robot iiwa 7",
        "joints 7",
        "moved 1",
        "added 'mark'",
        "removed 'mark'",
        "stopped",
    ]


FILES = {
    "ik_ros_examples/robots/kuka_lwr.urdf": "end_effector_ball",
    "ik_ros_examples/robots/kuka_lwr2.urdf": "lwr_world",
    "ik_ros_examples/rviz/kuka_lwr_example.rviz": "rpbi/world",
    "operator_node/configs/keyboard/keyboard_to_joy.yaml": "LEFT, RIGHT",
    "operator_node/configs/keyboard/keyboard_scale.yaml": "axes_idx: [0, 1, 2]",
    "teleop/configs/teleop_tf_demo_config.yaml": "target_frame_id: tf_target",
    "teleop/configs/teleop_tf_demo_spacenav_config.yaml": "axes_idx: [1, 0, 2, 4, 3, 5]",
}
"""Files that launch files of the release name, with a text in each."""


@pytest.mark.parametrize("name", FILES)
def test_files_are_found_under_their_names(name):
    package, _, path = name.partition("/")
    assert FILES[name] in Path(substitution_args.resolve_args(f"$(find {package})/{path}")).read_text()


@pytest.mark.parametrize(("robot", "tip"), [("kuka_lwr", "end_effector_ball"), ("kuka_lwr2", "end_effector_sponge")])
def test_solvers_take_its_robots(robot, tip):
    chain = {"base_link": "lwr_arm_0_link", "tip_link": tip}
    solver = make_solver("trac_ik", {"urdf_filename": f"{{ik_ros_examples}}/robots/{robot}.urdf", **chain})
    assert len(solver.joint_names) == 7


SCRIPT = """
import numpy as np
from keyboard.msg import Key
from sensor_msgs.msg import Joy
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, SetBoolRequest

from custom_ros_tools.config import load_configs
from custom_ros_tools.keyboard import KeyDownSubscriber
from custom_ros_tools.robot import JointStatePublisher, JointStateSubscriber, get_joint_state, resolve_joint_order
from custom_ros_tools.ros_comm import ToggleService, get_srv_handler, get_srv_handlers
from custom_ros_tools.tf import TfInterface
from operator_node.node import OperatorNode, main
from rpbi.ros_node import RosNode

node = RosNode("script", anonymous=True)
assert node.get_name().startswith("/script_")
tf = TfInterface()
frames = dict(parent_frame_id="world", child_frame_id="box")
pose = dict(pos=[1, 2, 3], orientation=[0, 0, 90], eul_deg=True)
sending = node.Timer(node.Duration(0.02), lambda event: tf.set_tf(**frames, **pose))
position, _ = tf.wait_for_tf(**frames, timeout=60.0)
assert position.tolist() == [1, 2, 3]
message = tf.wait_for_tf_msg(**frames, timeout=60.0)
assert tf.get_tf_msg(**frames).header.stamp >= message.header.stamp
assert tf.get_tf(**frames)[0].tolist() == [1, 2, 3]
assert node.wait_for_tf(**frames, timeout=60.0)[0].tolist() == [1, 2, 3]
sending.shutdown()
tf.set_matrix(**frames, T=np.eye(4))
packed = tf.pack_tf_msg(**frames, pos=[1, 0, 0], rot=[0, 0, 0, 1])
for name in ("pos", "quat", "eul", "pos_magnitude", "pos_quat", "pos_eul", "matrix"):
    getattr(tf, f"msg_to_{name}")(msg=packed)
transform = tf.pack_tf(pos=[1, 0, 0], rot=[0, 0, 0, 1])
for name in ("pos", "quat", "eul", "pos_magnitude"):
    getattr(tf, f"tf_msg_to_{name}")(msg=transform)
tf.pos_quat_to_matrix(pos=[1, 0, 0], quat=[0, 0, 0, 1])

toggle = ToggleService(name="toggle", enable_handler=lambda: (True, "on"), disable_handler=lambda: (False, "off"))
handler = get_srv_handler(srv_name="toggle", srv_type=SetBool, persistent=True, headers=None)
assert handler(True).message == "on" and handler(data=False).message == "off"
assert get_srv_handlers(srvs={"toggle": SetBool}, persistent=False)["toggle"](True).success
assert toggle.toggle(req=SetBoolRequest(data=True)).message == "on"
assert load_configs(s="a: 1") == {"a": 1}


class Doubled(OperatorNode):
    def __init__(self):
        super().__init__()
        self.factor = self.config["factor"]
        self.post_init()

    def callback(self, msg):
        self.publish(signal=self.factor * np.array(msg.axes))


node.set_param("~config", {"factor": 2.0})
doubled = Doubled()
signals, joy = [], node.Publisher("joy", Joy, queue_size=10)
node.Subscriber("operator_node/signal", Float64MultiArray, lambda message: signals.append(message.data))
assert doubled.start()[0] and not doubled.start()[0]
while (1.0, -2.0) not in signals:
    joy.publish(Joy(axes=[0.5, -1.0]))
    node.sleep(0.02)
assert doubled.stop()[0] and not doubled.stop()[0]
assert callable(main)

subscriber = JointStateSubscriber(topic_name="joint_states", joint_names=["b", "a"], ns="", callback=None)
publisher = JointStatePublisher(topic_name="joint_states", joint_names=["a", "b"], queue_size=10)
while not subscriber.recieved():
    publisher.publish(q=[1.0, 2.0], qd=[0.0, 0.0], eff=[0.0, 0.0])
    node.sleep(0.02)
assert subscriber.get_position().tolist() == [2.0, 1.0]
timer = node.Timer(node.Duration(0.02), lambda event: publisher.publish(q=[1.0, 2.0]))
state = get_joint_state(timeout=60.0, joint_names=["b"], ns="")
assert state.position == [2.0]
assert resolve_joint_order(msg=state, joint_names=["b"], ns="").position == [2.0]
timer.shutdown()

keys = KeyDownSubscriber(key_action_map={Key.KEY_1: lambda: None})
keys.unregister(), subscriber.unregister(), publisher.unregister(), toggle.shutdown()
print("all calls are known")
"""


@pytest.mark.quick
def test_python_is_called_with_the_keywords_of_the_release(ros):
    process = ros.start([sys.executable, "-c", SCRIPT])
    assert process.wait(200.0) == 0, ros.output(process)
    assert "all calls are known" in ros.output(process)
