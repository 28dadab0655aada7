"""What docs/custom_ros_tools.md shows does work."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
import rospy
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

PAGE = (Path(__file__).resolve().parents[3] / "docs/custom_ros_tools.md").read_text()
SNIPPETS = re.findall(r"```xml\n(.*?)```", PAGE, re.DOTALL)
EXAMPLES = {
    title: example
    for title, body in re.findall(r"^### (\S+)\n(.*?)(?=^##|\Z)", PAGE, re.DOTALL | re.MULTILINE)
    for example in re.findall(r"```python\n(.*?)```", body, re.DOTALL)
}


def test_all_launch_snippets_together_come_up(ros, tmp_path):
    (tmp_path / "all.launch").write_text(f"<launch>{''.join(SNIPPETS)}</launch>")
    launch = ros.start(["roslaunch", str(tmp_path / "all.launch")])
    assert ros.call("remap_joint_state/toggle", SetBool, True).success
    assert not ros.call("remap_joint_state_to_floatarray/toggle", SetBool, True).success, "it is the same switch"
    assert not ros.call("/robot/remap_joint_state/toggle", SetBool, True).success, "it is on from the start"
    rospy.wait_for_service("reset_tf", 60.0)
    transforms, markers = ros.listen("/tf", TFMessage), ros.listen("/cup/marker", Marker)
    wait_until(
        lambda: {m.transforms[0].child_frame_id for m in transforms.messages} == {"box", "cup"}, "both frames are told"
    )
    assert markers.wait_for(1)[0].header.frame_id == "rpbi/table"
    assert "has died" not in ros.output(launch)


@pytest.mark.parametrize("module", EXAMPLES)
def test_example_runs(ros, module):
    state = JointState(name=["lwr_arm_0_joint", "lwr_arm_1_joint"], position=[0.1, 0.2])
    states = rospy.Publisher("/rpbi/kuka_lwr/joint_states", JointState, latch=True, queue_size=1)
    states.publish(state)
    box = "rosrun custom_ros_tools resettable_static_transform_publisher 0.5 0 0.1 0 0 0 rpbi/world box"
    ros.start(box.split())
    code = EXAMPLES[module] if "ros_node" in module else f"import rospy\nrospy.init_node('a')\n{EXAMPLES[module]}"
    process = ros.start([sys.executable, "-c", code])
    assert process.wait(60.0) == 0, ros.output(process)
    states.unregister()


def test_every_module_of_the_page_has_an_example():
    assert list(EXAMPLES) == [
        *(f"custom_ros_tools.{name}" for name in ("config", "tf", "robot", "ros_comm", "keyboard")),
        "rpbi.ros_node",
    ]
    assert len(SNIPPETS) == 4
