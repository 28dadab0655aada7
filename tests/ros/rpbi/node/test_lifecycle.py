"""The node ends at once and cleanly, whatever it does just then and whoever hangs on to it."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time
from pathlib import Path

import pytest
import rospy
import yaml
from camera_world import renderers
from cob_srvs.srv import SetString
from node_world import Rosout, add, main_config, registrations, remove
from ros_system import support_on_path, wait_until
from std_msgs.msg import Int64
from std_srvs.srv import Trigger
from worlds import FLOOR, ball, iiwa

from ros_pybullet_interface.msg import PybulletObject
from ros_pybullet_interface.srv import AddPybulletObject

NODE = "/ros_pybullet_interface"
ENDS_WITHIN_S = 60.0  # it takes less than 2 s; a busy machine must not fail the test
CAMERA = {"name": "camera", "object_tf": {"tf_id": "camera"}, "intrinsics": {"width": 64, "height": 48}}
STATES = {
    "running": {},
    "stopped": {"start_pybullet_after_initialization": False},
    "as fast as it goes": {"real_time_factor": 0},
    "with a camera": {"rgbd_sensor": CAMERA},
}


def _config(folder, **more):
    return main_config(
        folder,
        collision=({**FLOOR, "object_tf": {"tf_id": "nowhere"}},),
        dynamic=(ball(broadcast_hz=200, basePosition=[1.0, 0.0, 0.5]),),
        robots=(iiwa(joint_state_publisher_hz=500, broadcast_link_states=True),),
        **more,
    )


def _interrupt(ros, process, number=signal.SIGINT):
    """Ends a node as Ctrl-C would and checks that nothing of it is left."""
    os.killpg(process.pid, number)
    assert process.wait(ENDS_WITHIN_S) == 0, ros.output(process)
    assert "Traceback" not in ros.output(process) and "Error" not in ros.output(process), ros.output(process)
    assert _members(process.pid) == []
    assert registrations() == []
    assert registrations(f"{NODE}_camera") == []


def _members(group):
    """Returns the processes of a group; the dead whom init has not buried yet are none."""
    listed = subprocess.run(["ps", "-eo", "pid,pgid,args"], capture_output=True, text=True, check=True).stdout
    return [line for line in listed.splitlines()[1:] if line.split()[1] == str(group) and "<defunct>" not in line]


def _takes_signals(process):
    """Tells whether the program is so far that it blocks SIGINT to wait for it; rosrun and Python come before."""
    here = Path(f"/proc/{process.pid}")
    blocked = next(line for line in (here / "status").read_text().splitlines() if line.startswith("SigBlk"))
    return "python" in os.readlink(here / "exe") and int(blocked.split()[1], 16) >> (signal.SIGINT - 1) & 1


@pytest.mark.parametrize(
    "delay_s", [0.0, 0.6, *(pytest.param(s, marks=pytest.mark.thorough) for s in (0.1, 0.3, 1.0, 1.5))]
)
def test_ctrl_c_while_it_starts(ros, tmp_path, delay_s):
    process = ros.simulator(_config(tmp_path, rgbd_sensor=CAMERA), use_sim_time=True, wait=False, fresh=True)
    wait_until(lambda: _takes_signals(process), "the program begins")
    time.sleep(delay_s)
    _interrupt(ros, process)


@pytest.mark.parametrize(
    "simulated",
    [pytest.param(True, id="sim time"), pytest.param(False, id="wall time", marks=pytest.mark.thorough)],
)
@pytest.mark.parametrize("state", STATES)
def test_ctrl_c_in_every_state(ros, tmp_path, state, simulated):
    process = ros.simulator(_config(tmp_path, **STATES[state]), use_sim_time=simulated)
    if state == "with a camera":
        wait_until(lambda: registrations(f"{NODE}_camera"), "the camera is up")
    _interrupt(ros, process)


def test_a_camera_that_hangs_is_killed_and_leaves_no_registrations(ros, tmp_path):
    process = ros.simulator(_config(tmp_path, rgbd_sensor=CAMERA))
    wait_until(lambda: registrations(f"{NODE}_camera"), "the camera is up")
    (renderer,) = renderers(process)
    os.kill(renderer, signal.SIGSTOP)
    _interrupt(ros, process)


@pytest.mark.quick
def test_sigterm_and_a_second_ctrl_c_are_no_worse(ros, tmp_path):
    process = ros.simulator(_config(tmp_path))
    os.killpg(process.pid, signal.SIGTERM)
    time.sleep(0.05)
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGINT)
    assert process.wait(ENDS_WITHIN_S) == 0
    assert "Traceback" not in ros.output(process), ros.output(process)
    assert registrations() == []


def test_rosnode_kill_ends_it(ros, tmp_path):
    process = ros.simulator(_config(tmp_path))
    subprocess.run(["rosnode", "kill", NODE], check=True, capture_output=True, timeout=120.0)
    assert process.wait(ENDS_WITHIN_S) == 0, ros.output(process)
    assert "Traceback" not in ros.output(process), ros.output(process)


@pytest.mark.thorough
def test_a_camera_whose_node_is_killed_comes_back(ros, tmp_path):
    process = ros.simulator(_config(tmp_path, rgbd_sensor=CAMERA))
    published = ("publishes", "/rpbi/camera/colour/image")
    wait_until(lambda: published in registrations(f"{NODE}_camera"), "the camera is up")
    subprocess.run(["rosnode", "kill", f"{NODE}_camera"], check=True, capture_output=True, timeout=120.0)
    wait_until(lambda: "it is started again" in ros.output(process), "the simulator sees that it has gone")
    wait_until(lambda: published in registrations(f"{NODE}_camera"), "the camera is up again")


def test_ctrl_c_ends_the_node_despite_a_blocked_subscriber(ros, tmp_path):
    process = ros.simulator(_config(tmp_path), use_sim_time=True)
    holder = _holder(ros, "/clock", "/tf", "/rpbi/iiwa/joint_states")
    os.kill(holder.pid, signal.SIGSTOP)
    try:
        time.sleep(3.0)  # until its sockets are full
        _interrupt(ros, process)
    finally:
        os.kill(holder.pid, signal.SIGCONT)


def _holder(ros, *topics):
    holder = ros.start_program("hold_topics.py", *topics)
    wait_until(lambda: "listening" in ros.output(holder), "it listens")
    return holder


def test_services_waiting_at_shutdown_get_an_answer_or_an_error(ros, tmp_path):
    process = ros.simulator(_config(tmp_path))
    outcomes = []

    def trigger(name):
        rospy.ServiceProxy(f"/rpbi/{name}", Trigger)()

    def come_and_go():
        new = PybulletObject(PybulletObject.ROBOT, "", yaml.safe_dump(iiwa("new", broadcast_link_states=True)))
        rospy.ServiceProxy("/rpbi/add_pybullet_object", AddPybulletObject)(new)
        rospy.ServiceProxy("/rpbi/remove_pybullet_object", SetString)("new")

    def repeat(call, *arguments):
        while True:
            try:
                call(*arguments)
            except Exception as error:  # rospy raises exceptions of many kinds when a node goes
                outcomes.append(error)
                return

    calls = [(trigger, "start"), (trigger, "stop"), (trigger, "step"), (come_and_go,), (come_and_go,)]
    threads = [threading.Thread(target=repeat, args=call, daemon=True) for call in calls]
    for thread in threads:
        thread.start()
    time.sleep(0.5)
    _interrupt(ros, process)
    for thread in threads:
        thread.join(ENDS_WITHIN_S)
    assert len(outcomes) == len(threads), "somebody still waits"


def test_unstable_world_stops_and_is_reported_once(ros, tmp_path):
    rosout = Rosout(ros)
    config = _config(tmp_path, start_pybullet_after_initialization=False, trusted_packages=["faulty_lab"])
    process = ros.simulator(config, **support_on_path())
    status = ros.listen("/rpbi/status", Int64)
    fast = ball("fast", basePosition=[0.0, 0.0, 50.0], broadcast_hz=1000, type="faulty_lab:Runaway")
    assert add(ros, PybulletObject.DYNAMIC, fast).success
    for _ in range(2):
        assert ros.call("/rpbi/start", Trigger).success
        wait_until(lambda: ros.call("/rpbi/start", Trigger).success or status.messages[-1].data == 0, "it breaks")
        wait_until(lambda: status.messages[-1].data == 0, "it stands still")
        time.sleep(0.5)
        assert process.poll() is None, ros.output(process)
    rosout.wait_for(["simulation stopped"])
    said = [log.msg for log in rosout.logs("simulation stopped")]
    assert 1 <= len(said) <= 4 and "fast: pose is not finite any more" in said[0], said
    step = ros.call("/rpbi/step", Trigger)
    assert not step.success and "not finite" in step.message
    assert remove(ros, "fast").success
    assert ros.call("/rpbi/step", Trigger).success, "without it, the world is fine again"
    _interrupt(ros, process)


def test_it_survives_the_master_and_still_ends_on_ctrl_c(ros, tmp_path, second_master):
    second_master.api.setParam(f"{NODE}/config", _config(tmp_path))
    process = ros.simulator({}, wait=False, **second_master.environment)
    wait_until(lambda: second_master.has("/rpbi/list_objects"), "the node is up")
    second_master.kill()
    printed = len(ros.output(process))
    time.sleep(3.0)
    assert process.poll() is None
    assert len(ros.output(process)) - printed < 1000, ros.output(process)[printed:]
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(ENDS_WITHIN_S) == 0, ros.output(process)
    assert "Traceback" not in ros.output(process)
    assert _members(process.pid) == []


def test_ctrl_c_while_it_waits_for_a_master(ros, tmp_path, second_master):
    second_master.kill()
    process = ros.simulator({}, wait=False, **second_master.environment)
    wait_until(lambda: "is roscore running?" in ros.output(process), "it waits")
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(ENDS_WITHIN_S) == 0, ros.output(process)
    assert "Traceback" not in ros.output(process)
