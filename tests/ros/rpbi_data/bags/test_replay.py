"""Sessions recorded from the simulator, replayed from their bags by the command."""

from __future__ import annotations

import io
import itertools
import math
import os
import re
import shutil
import subprocess
import time
from contextlib import redirect_stderr, redirect_stdout

import pytest
import rosbag
import rospy
from cob_srvs.srv import SetString
from custom_srvs.srv import SetTransform
from geometry_msgs.msg import Quaternion, Transform, Twist, Vector3
from mobile_base import mobile_base
from node_world import add, main_config, publishing, remove
from ros_system import wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from worlds import FLOOR, ball, box, iiwa

from custom_ros_tools.console.modules import command_of
from ros_pybullet_interface.msg import SimulationState, WorldCommands
from ros_pybullet_interface.srv import ChangeDynamics, ResetJointState, SetJointState, StepN
from rpbi_data import Recorder

TOPICS = ["/rpbi/world_description", "/rpbi/state", "/rpbi/commands"]
JOINTS = ["lbr_iiwa_joint_1", "lbr_iiwa_joint_2", "lbr_iiwa_joint_4"]


def _world(folder, **main):
    arm = iiwa(
        initial_joint_position={"lbr_iiwa_joint_2": 50.0, "lbr_iiwa_joint_4": -60.0},
        joint_trajectory_controller={},
        broadcast_link_states=True,
    )
    things = tuple(box(f"box{turn}", basePosition=[0.5, 0.03 * turn, 0.1 + 0.21 * turn]) for turn in range(4))
    table = {**box("table"), "object_tf": {"tf_id": "table", "hz": 50}}
    del table["baseMass"]
    base = mobile_base(folder, loadURDF={"basePosition": [-1.0, 0.0, 0.0]})
    parts = {"collision": (FLOOR, table), "dynamic": things, "robots": (arm, base)}
    return main_config(folder, **parts, **{"timeStep": 0.002, "state_hash_hz": 20.0, **main})


def _session(ros, seconds):
    """Does to the world what can be done by ROS."""
    begin_s = time.monotonic()
    with (
        publishing("/rpbi/iiwa/joint_states/target", JointState) as target,
        publishing("/rpbi/mobile/cmd_vel", Twist) as cmd_vel,
        publishing("/rpbi/iiwa/joint_trajectory_controller/command", JointTrajectory) as command,
    ):
        for turn in range(int(seconds * 50)):
            phase = 2.0 * math.pi * turn / 50
            target.publish(JointState(name=JOINTS, position=[math.sin(phase), 0.8 + 0.3 * math.sin(2 * phase), -1.0]))
            cmd_vel.publish(Twist(linear=Vector3(math.sin(phase), 0.3, 0.0)))
            if turn == 20:
                assert add(ros, config=ball("visitor", basePosition=[0.5, 0.3, 1.5])).success
                change = "{mass: 0.3, lateralFriction: 0.2}"
                assert ros.call("/rpbi/change_dynamics", ChangeDynamics, "box1", change).success
            if turn == 40:
                there = Transform(Vector3(0.6, 0.0, 0.5), Quaternion(0.0, 0.0, 0.0, 1.0))
                assert ros.call("/rpbi/box0/set_pose", SetTransform, there).success
                assert remove(ros, "box3").success
            if turn == 60:
                assert ros.call("/rpbi/stop", Trigger).success
                assert ros.call("/rpbi/step_n", StepN, 77).success
                assert ros.call("/rpbi/start", Trigger).success
            if turn == 70:
                ros.call("/rpbi/iiwa/set_control_mode", SetString, "TORQUE_CONTROL")
            if turn == 75:
                ros.call("/rpbi/iiwa/set_control_mode", SetString, "POSITION_CONTROL")
                goal = JointState(name=JOINTS[:1], position=[0.5])
                ros.call("/rpbi/iiwa/set_joint_state", SetJointState, JointState(name=JOINTS[:1], position=[0.2]))
                ros.call("/rpbi/iiwa/move_to_joint_state", ResetJointState, goal, 0.3)
            if turn == 80:
                point = JointTrajectoryPoint(positions=[0.3] * 7, time_from_start=rospy.Duration(0.4))
                names = [f"lbr_iiwa_joint_{number}" for number in range(1, 8)]
                command.publish(JointTrajectory(joint_names=names, points=[point]))
            time.sleep(max(0.0, begin_s + turn / 50 - time.monotonic()))


def _replay(bag, *arguments):
    """Replays a bag in this process; returns the exit code and what was printed, as `subprocess.run` does."""
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as errors:
        code = command_of("rpbi_data.console.replay").run([str(bag), "--quiet", *arguments])
    return subprocess.CompletedProcess(arguments, code, out.getvalue(), errors.getvalue())


def _reached(states, tick, resets=0):
    """Waits until the world has come to a tick, and returns the one at which it is."""

    def now():
        newest = states.messages[-1] if states.messages else None
        return newest and newest.resets == resets and newest.tick >= tick and newest.tick

    return wait_until(now, f"tick {tick} comes after reset {resets}")


@pytest.fixture(scope="module")
def bag(ros_master, tmp_path_factory):
    """A recording that begins when the world has run for a while, with a reset in it."""
    from ros_system import RosSystem

    folder = tmp_path_factory.mktemp("replay")
    ros = RosSystem(folder)
    try:
        ros.start(["rosrun", "tf2_ros", "static_transform_publisher", *"0.5 0.4 0.1 0 0 0 rpbi/world table".split()])
        ros.simulator(_world(folder), use_sim_time=True)
        states = ros.listen("/rpbi/state", SimulationState)
        with publishing("/rpbi/iiwa/joint_states/target", JointState) as target:
            begin = _reached(states, tick=1)
            target.publish(JointState(name=JOINTS[:1], position=[0.4]))
            begin = _reached(states, tick=begin + 500)
        path = folder / "session.bag"
        with Recorder(path, TOPICS):
            begin = states.messages[-1].tick
            _session(ros, 2.5)
            _reached(states, tick=begin + 1250)
            assert ros.call("/rpbi/reset", Trigger).success
            _reached(states, tick=250, resets=1)
            _session(ros, 1.0)
            _reached(states, tick=750, resets=1)
        yield path
    finally:
        ros.close()


@pytest.mark.thorough
@pytest.mark.quick
def test_a_session_is_the_same_in_a_new_process(bag):
    environment = {**os.environ, "ROS_MASTER_URI": "http://127.0.0.1:1"}  # it needs none
    command = ["rosrun", "rpbi_utils", "replay", str(bag), "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=500)
    assert done.returncode == 0, done.stdout + done.stderr
    agreed, ticks = (int(word) for word in done.stdout.split() if word.isdigit())
    assert agreed > 60 and ticks > 1500
    kinds = set()
    with rosbag.Bag(str(bag)) as opened:
        for _, message, _ in opened.read_messages(["/rpbi/commands"]):
            kinds |= {command.what for command in message.commands}
    assert {"input", "add", "remove", "dynamics", "pause"} <= kinds
    assert {"teleport", "set_joint_state", "switch_mode", "move", "follow"} <= kinds


def _changed(bag, path, change):
    """Writes a bag in which `change` has seen each message; it may return None for one to leave out."""
    with rosbag.Bag(str(bag)) as given, rosbag.Bag(str(path), "w") as written:
        for topic, message, stamp in given.read_messages():
            message = change(topic, message)
            if message is not None:
                written.write(topic, message, stamp)
    return path


@pytest.mark.thorough
def test_the_first_differing_tick_is_named(bag, tmp_path):
    def spoil(topic, message):
        if topic == "/rpbi/state" and message.state_hash and message.resets == 1 and message.tick >= 300:
            message.state_hash = "0" * 32
        return message

    done = _replay(_changed(bag, tmp_path / "spoilt.bag", spoil))
    assert done.returncode == 1
    assert "first difference at tick 300 after reset 1, after tick 275" in done.stdout


def test_bag_that_begins_too_late_is_reported_with_a_remedy(bag, tmp_path):
    seen = []

    def cut(topic, message):
        if topic == "/rpbi/commands" and message.resets == 0 and not seen:
            seen.append(message)
            return None
        return message

    done = _replay(_changed(bag, tmp_path / "late.bag", cut))
    assert done.returncode == 1
    assert "command 0 is not in the recording" in done.stdout
    assert "states agree" in done.stdout, "what follows the reset can be replayed"


@pytest.mark.parametrize("topic", ["/rpbi/world_description", "/rpbi/state"])
def test_a_bag_without_the_topics_is_refused(bag, tmp_path, topic):
    done = _replay(_changed(bag, tmp_path / "other.bag", lambda name, message: None if name == topic else message))
    assert done.returncode == 1
    assert f"no messages of {topic}" in done.stderr


def test_a_bag_without_hashes_is_refused(bag, tmp_path):
    def strip(topic, message):
        if topic == "/rpbi/state":
            message.state_hash = ""
        return message

    done = _replay(_changed(bag, tmp_path / "plain.bag", strip))
    assert done.returncode == 1
    assert "no hashes" in done.stderr


def test_a_bag_of_two_sessions_is_refused(bag, tmp_path):
    turn = []

    def renew(topic, message):
        if topic == "/rpbi/world_description":
            turn.append(message)
            message.data = message.data.replace('"file": ', '"file":  ')
        return message

    path = _changed(bag, tmp_path / "two.bag", renew)
    with rosbag.Bag(str(bag)) as given, rosbag.Bag(str(path), "a") as written:
        for topic, message, stamp in given.read_messages(["/rpbi/world_description"]):
            written.write(topic, message, stamp)
    done = _replay(path)
    assert done.returncode == 1 and "was restarted during the recording" in done.stderr


def test_a_truncated_bag_is_refused(bag, tmp_path):
    path = tmp_path / "cut.bag"
    shutil.copy(bag, path)
    os.truncate(path, path.stat().st_size // 2)
    done = _replay(path)
    assert done.returncode == 1
    assert "rosbag reindex" in done.stderr


def test_a_description_of_another_version_is_refused(bag, tmp_path):
    def age(topic, message):
        return String('{"format": 0}') if topic == "/rpbi/world_description" else message

    done = _replay(_changed(bag, tmp_path / "old.bag", age))
    assert done.returncode == 1
    assert "format 0" in done.stderr


HOSTILE = {
    "a type of nobody": (("rpbi.config.world:WorldConfig", "this:x"), "'this:x' is not trusted, so it is not imported"),
    "a type of an object": (
        ('"type": "dynamic"', '"type": "this:x"'),
        "'this:x' is not trusted, so it is not imported",
    ),
    "no world": (("rpbi.config.world:WorldConfig", "rpbi.config.world:Nothing"), "has no 'Nothing'"),
    "no objects": (('"objects": [', '"objects": 3, "others": ['), "description cannot be read: objects: expected"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_a_hostile_description_is_refused_in_one_line(bag, tmp_path, case):
    (old, new), told = HOSTILE[case]

    def replace(topic, message):
        if topic == "/rpbi/world_description":
            assert old in message.data
            message.data = message.data.replace(old, new)
        return message

    done = _replay(_changed(bag, tmp_path / "hostile.bag", replace))
    assert done.returncode == 1
    [line] = done.stderr.splitlines()
    assert line.startswith("replay: ") and told in line


def test_endless_ticks_and_kernel_files_are_refused(bag, tmp_path):
    def spoil(topic, message):
        if topic == "/rpbi/state" and message.resets == 0:
            message.tick = 900_000_000
        return message

    done = _replay(_changed(bag, tmp_path / "late.bag", spoil))
    assert done.returncode == 1
    assert re.search(r"expected at most 20000000 ticks, got states that are 900\d{6} ticks from the start", done.stderr)

    def read_kernel(topic, message):
        if topic == "/rpbi/world_description":
            message.data = message.data.replace('"files": {', '"files": {"/proc/kmsg": "0", "/dev/zero": "0", ')
        return message

    assert _replay(_changed(bag, tmp_path / "kernel.bag", read_kernel)).returncode == 0


def test_another_namespace_is_asked_for_and_found(bag, tmp_path):
    path = tmp_path / "named.bag"
    with rosbag.Bag(str(bag)) as given, rosbag.Bag(str(path), "w") as written:
        for topic, message, stamp in given.read_messages():
            written.write(f"/left{topic}", message, stamp)
    done = _replay(path)
    assert done.returncode == 1 and "--ns" in done.stderr
    assert _replay(path, "--ns", "left").returncode == 0


def test_who_comes_late_gets_all_commands(ros, tmp_path):
    ros.simulator(_world(tmp_path), use_sim_time=True)
    with publishing("/rpbi/iiwa/joint_states/target", JointState) as target:
        state = ros.listen("/rpbi/state", SimulationState)
        turns = itertools.count()

        def has_many() -> bool:
            target.publish(JointState(name=JOINTS[:1], position=[next(turns) * 1e-3]))
            return state.messages[-1].commands > 100

        wait_until(has_many, "there are more commands than fit in one message", every_s=0.004)
        commands = ros.listen("/rpbi/commands", WorldCommands)
        total = state.messages[-1].commands
        known: dict[int, str] = {}

        def all_known():
            for message in list(commands.messages):
                known.update({message.first + i: one.data for i, one in enumerate(message.commands)})
            return set(range(total)) <= set(known)

        wait_until(all_known, "all of them are told")
        target.publish(JointState(name=JOINTS[:1], position=[0.7]))
        wait_until(lambda: all_known() and any("[0,0.7]" in data for data in known.values()), "new ones, too")
