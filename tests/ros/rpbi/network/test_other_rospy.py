"""Where rospy is built otherwise than expected, nodes say so at their start and go on with what it offers anybody."""

from __future__ import annotations

import os
import re
import shutil
import sys
from pathlib import Path

import pytest
import rospy
from node_world import main_config, registrations
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from worlds import iiwa

NODE = "/ros_pybullet_interface"
JOINT_STATES = "/rpbi/iiwa/joint_states"
BUILT_OTHERWISE = "this rospy has different internals: expected "
SENDING = "messages are sent by rospy's queues and threads, which is slower at high rates"
REGISTERING = "a restarted ROS master will not know this node: restart the node then"
REMOVING = "a subscriber that connects while another one ends may receive nothing"
LOGGING = "logging blocks while the master hangs"
SENDERS = {
    "a publisher's implementation": (r"\bself\.impl\b", "self.inner"),
    "the list of connections": (r"\bself\.connections\b", "self.links"),
    "the sockets of connections": (r"\b(self|conn)\.socket\b", r"\1.wire"),
    "no list of connections of its own": (
        r"new_connections = self\.connections\[:\]",
        "new_connections = self.connections",
    ),
}
SENDER, *MORE_SENDERS = SENDERS
"""Parts that are called otherwise or are otherwise, as regular expressions over all of rospy."""
MASTER_PARTS = {"RegManager": "MasterLink", "get_param_server_cache": "parameter_cache"}


def _other_rospy(folder: Path, *renamed: tuple[str, str]) -> dict[str, str]:
    """Makes a rospy that works as the one here, with other private parts; returns what programs need to find it."""
    shutil.copytree(Path(rospy.__file__).parent, folder / "rospy")
    changed = 0
    for path in (folder / "rospy").rglob("*.py"):
        text = path.read_text()
        for pattern, other in renamed:
            text, count = re.subn(pattern, other, text)
            changed += count
        path.write_text(text)
    assert changed, "this rospy is another one already"
    return {"PYTHONPATH": f"{folder}{os.pathsep}{os.environ['PYTHONPATH']}"}


def _config(folder: Path) -> dict:
    return main_config(folder, robots=(iiwa(joint_state_publisher_hz=100),))


def _lines(ros, process, text: str) -> list[str]:
    return [line for line in ros.output(process).splitlines() if text in line]


@pytest.mark.parametrize("part", [SENDER, *(pytest.param(part, marks=pytest.mark.thorough) for part in MORE_SENDERS)])
def test_the_simulator_sends_by_ordinary_publishers(ros, tmp_path, part):
    environment = _other_rospy(tmp_path, SENDERS[part])
    process = ros.simulator(_config(tmp_path), use_sim_time=True, **environment)
    (line,) = _lines(ros, process, BUILT_OTHERWISE)
    assert line.endswith(SENDING)
    stamps = ros.listen(JOINT_STATES, JointState)
    stamps.wait_for(50)
    assert {new - old for old, new in zip(stamps.stamps_ns, stamps.stamps_ns[1:])} == {10_000_000}
    stamps.close()
    assert ros.call("/rpbi/stop", Trigger).message == "stopped"
    answer = ros.call("/rpbi/step", Trigger).message
    late = ros.listen(JOINT_STATES, JointState).wait_for(1)[0].header.stamp
    assert answer.endswith(f"stamp {late.secs}.{late.nsecs:09d}"), "who comes late gets the last one"
    assert "Traceback" not in ros.output(process), ros.output(process)


def test_returning_master_is_noticed_although_nothing_registers_again(ros, tmp_path, second_master):
    environment = _other_rospy(tmp_path, *MASTER_PARTS.items())
    second_master.api.setParam(f"{NODE}/config", _config(tmp_path))
    process = ros.simulator({}, wait=False, **environment, **second_master.environment)
    wait_until(lambda: second_master.has("/rpbi/get_state_hash"), "the simulator is up")
    said = _lines(ros, process, BUILT_OTHERWISE)
    assert [line.rpartition("; ")[2] for line in said] == [REGISTERING, LOGGING]
    listening = ros.start(["rostopic", "echo", "-p", f"{JOINT_STATES}/header/seq"], **second_master.environment)
    wait_until(lambda: ros.output(listening).count("\n") > 10, "joint states come")
    second_master.kill()
    wait_until(lambda: _lines(ros, process, "cannot be reached"), "the simulator misses the master")
    second_master.start()
    wait_until(lambda: _lines(ros, process, f"was restarted: it does not know {NODE}"), "it sees the next one")
    before = ros.output(listening).count("\n")
    wait_until(lambda: ros.output(listening).count("\n") > before + 10, "joint states still come")
    assert second_master.registrations(NODE) == []
    assert process.poll() is None and "Traceback" not in ros.output(process), ros.output(process)


def test_the_simulator_leaves_the_removal_of_connections_to_rospy(ros, tmp_path):
    environment = _other_rospy(tmp_path, (r"\b_remove_connection\b", "_drop_connection"))
    process = ros.simulator(_config(tmp_path), use_sim_time=True, **environment)
    (line,) = _lines(ros, process, BUILT_OTHERWISE)
    assert line.endswith(REMOVING)
    ros.listen(JOINT_STATES, JointState).wait_for(10)
    assert "Traceback" not in ros.output(process), ros.output(process)


def test_the_rospy_that_is_here_is_as_expected(ros, tmp_path):
    process = ros.simulator(_config(tmp_path))
    assert registrations() and not _lines(ros, process, BUILT_OTHERWISE)


ENDS_AS_IT_STARTS = """
import rospy
from std_msgs.msg import Empty
from custom_ros_tools.ros.rospy_internals import DirectSending

rospy.init_node("ends_as_it_starts", disable_signals=True)
publisher = rospy.Publisher("topic", Empty, queue_size=1)
rospy.signal_shutdown("interrupted")
print("sends:", DirectSending.of(publisher, 1))
"""


def test_node_interrupted_at_its_start_does_not_mention_rospy(ros):
    process = ros.start([sys.executable, "-c", ENDS_AS_IT_STARTS])
    assert process.wait(120.0) == 0
    assert ros.output(process) == "sends: None\n"
