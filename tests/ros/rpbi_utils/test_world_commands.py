"""`./rpbi list` and the other commands of a running world, up to `gravity`."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest
import rospy
from mobile_base import mobile_base
from nav_msgs.msg import Odometry
from node_world import main_config, objects
from ros_system import RosSystem, find_executable, wait_until
from sensor_msgs.msg import JointState
from terminal import Terminal
from worlds import FLOOR, box, iiwa

from custom_ros_tools.config import load_config
from custom_ros_tools.console.modules import command_of
from ros_pybullet_interface.srv import ListObjects, ListObjectsResponse
from rpbi.bodies import BODY_TYPES
from rpbi.world.loading import load_world
from rpbi_utils.console.spawn import kind_in

CONFIGS = Path(__file__).resolve().parents[3] / "src/rpbi_examples/configs"


@pytest.fixture(scope="module")
def ros(ros_master, tmp_path_factory):
    """A world in the namespace `lab`, with two robots."""
    folder = tmp_path_factory.mktemp("world commands")
    system = RosSystem(folder)
    try:
        robots = (iiwa("arm"), mobile_base(folder, loadURDF={"basePosition": [-1.0, 0.0, 0.0]}))
        world = main_config(folder, timeStep=0.004, collision=(FLOOR,), robots=robots)
        system.simulator(world, namespace="/lab/")
        yield system
    finally:
        system.close()


@pytest.fixture
def say(ros, capsys):
    """Runs a command in the namespace; returns its exit code and what it printed on both streams."""

    def run(line: str, *more: str) -> tuple[int, str]:
        name, *words = line.split()
        command = command_of(f"rpbi_utils.console.{name}")
        code = command.run([*words, *more, "--ns", "lab"])
        printed = capsys.readouterr()
        return code, (printed.out + printed.err).strip()

    return run


def position(ros, name: str) -> tuple[float, float, float]:
    """Returns where a body is."""
    states = ros.listen(f"/lab/rpbi/{name}/base_state", Odometry)
    at = states.wait_for()[-1].pose.pose.position
    return at.x, at.y, at.z


def in_process(*words: str) -> subprocess.CompletedProcess[str]:
    command = [find_executable("rpbi_utils", "world"), *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=300.0)


def test_object_can_be_spawned_under_another_name_and_pose(ros, say):
    file = ros.write_yaml("box.yaml", box("box", base_state_hz=50))
    assert say("spawn", file, "--name", "second", "--at", "0.5", "-1e0", "0.1", "--rpy", "0", "0", "-90deg") == (
        0,
        "added 'second'",
    )
    assert position(ros, "second") == pytest.approx((0.5, -1.0, 0.1), abs=0.01)
    assert say("list") == (0, "floor   collision\narm     robot\nmobile  mobile_robot\nsecond  dynamic")
    assert say("move second 0.5 1 0.1") == (0, "'second' was put there")
    assert say("send second --push 30 0 0 --for 0.2") == (0, "acts on 'second' for 0.2 s")
    wait_until(lambda: position(ros, "second")[0] > 0.52, "the box is pushed")
    assert say("remove second floor nothing")[0] == 1, "all or none"
    assert say("remove second") == (0, "removed 'second'")
    assert "second" not in objects(ros, "/lab/")


def test_a_urdf_needs_no_yaml(ros, say):
    assert say("spawn kuka_iiwa/model.urdf --type robot --name other --at 0 1.5 0") == (0, "added 'other'")
    assert say("spawn r2d2.urdf --at 2 2 0.6") == (0, "added 'r2d2'")
    assert {"other": "robot", "r2d2": "urdf"}.items() <= objects(ros, "/lab/").items()
    assert say("remove other r2d2") == (0, "removed 'other'\nremoved 'r2d2'")


def test_files_near_the_yaml_are_found_although_keys_differ(ros, say):
    (ros.folder / "part.urdf").write_text('<robot name="p"><link name="l"/></robot>')
    file = ros.write_yaml("part.yaml", {"name": "part", "loadURDF": {"fileName": "part.urdf", "useFixedBase": True}})
    assert say("spawn", file, "--name", "part_2", "--at", "3", "3", "1") == (0, "added 'part_2'")
    assert say("remove part_2")[0] == 0


def test_a_camera_comes_and_goes(ros, say):
    camera = {"name": "eye", "hz": 1, "intrinsics": {"width": 32, "height": 24, "fov": 60, "range": [0.1, 5.0]},
              "object_tf": {"tf_id": "eye", "hz": 10}}  # fmt: skip
    file = ros.write_yaml("eye.yaml", camera)
    assert say("spawn", file, "--at", "0", "0", "1")[1].endswith("object_tf says, not --at or --rpy")
    assert say("spawn", file) == (0, "added 'eye'")
    assert say("remove eye") == (0, "removed 'eye'")


def test_joints_and_links_move_in_a_given_time(ros, say):
    code, text = say("move arm lbr_iiwa_joint_2:=30deg lbr_iiwa_joint_4:=-1.2 --in 0.3")
    assert code == 0 and text.startswith("reached")
    state = ros.listen("/lab/rpbi/arm/joint_states", JointState).wait_for()[-1]
    assert dict(zip(state.name, state.position))["lbr_iiwa_joint_2"] == pytest.approx(0.5236, abs=0.01)
    code, text = say("move arm/lbr_iiwa_link_7 0.5 -0.2 0.6 180deg 0 0 --in 0.5")
    assert code == 0 and "link 'lbr_iiwa_link_7' is" in text
    assert say("move arm/lbr_iiwa_link_7 5 0 0 --in 0.5")[0] == 1
    assert say("move arm --home --in 0.5")[0] == 0
    assert say("move arm --stop") == (1, "move: no motion is running")


def test_positions_beyond_limits_and_targets_of_other_modes_are_refused(ros, say):
    within = "joint 'lbr_iiwa_joint_2' must be within -2.0944 to 2.0944 rad, got"
    for command in ("move", "send"):
        assert say(f"{command} arm lbr_iiwa_joint_2:=30") == (1, f"{command}: {within} 30; 30deg?")
        assert say(f"{command} arm lbr_iiwa_joint_2:=150deg") == (1, f"{command}: {within} 2.61799")
        assert say(f"{command} arm lbr_iiwa_joint_2:=3000") == (1, f"{command}: {within} 3000")
    switch = "switch it first: rosservice call /lab/rpbi/arm/set_control_mode VELOCITY_CONTROL"
    assert say("send arm lbr_iiwa_joint_2:=0.1 --velocity") == (
        1,
        f"send: 'arm' is under POSITION_CONTROL, which takes positions, not velocities; {switch}",
    )
    code, text = say("send arm lbr_iiwa_joint_2:=0.1 --effort")
    assert code == 1 and text.endswith("set_control_mode TORQUE_CONTROL")


def test_targets_and_velocities_are_sent(ros):
    states = ros.listen("/lab/rpbi/arm/joint_states", JointState)
    done = in_process("send", "arm", "lbr_iiwa_joint_1:=-0.4", "--ns", "lab")
    assert (done.returncode, done.stdout, done.stderr) == (0, "sent\n", "")
    wait_until(lambda: states.messages and states.messages[-1].position[0] < -0.39, "the joint is there")
    x, _, _ = position(ros, "mobile")
    done = in_process("send", "mobile", "--drive", "0.5", "0", "0", "--for", "0.5", "--ns", "lab")
    assert (done.returncode, done.stdout, done.stderr) == (0, "drove for 0.5 s\n", "")
    wait_until(lambda: position(ros, "mobile")[0] > x + 0.1, "it has driven")


def test_attached_box_stays_until_detached_and_rises_under_inverted_gravity(ros, say):
    file = ros.write_yaml("hung.yaml", box("hung", base_state_hz=50))
    assert say("spawn", file, "--at", "1", "1", "0.5")[0] == 0
    assert say("attach hung arm/lbr_iiwa_link_7 --max-force 500") == (
        0,
        "'hung' is attached to 'arm/lbr_iiwa_link_7'",
    )
    code, text = say("move hung 1 1 2")
    assert code == 1 and "held by attachment 'hung'" in text
    assert say("detach hung")[0] == 0
    assert say("detach hung")[0] == 1
    wait_until(lambda: position(ros, "hung")[2] < 0.2, "it has fallen")
    code, text = say("gravity 0 0 1.62")
    assert code == 0 and "1.62" in text
    wait_until(lambda: position(ros, "hung")[2] > 0.3, "it rises")
    assert say("gravity 0 0 -9.81")[0] == 0
    assert say("attach hung floor --name stand --ball") == (0, "'hung' is attached to 'floor'")
    assert say("detach stand")[0] == 0
    assert say("remove hung")[0] == 0


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("spawn nothing.yaml", "spawn: no such file: nothing.yaml (looked in "),
        ("spawn {nothing}/box.yaml", "spawn: unknown ROS package 'nothing'"),
        ("remove amr", "remove: unknown object 'amr': known are floor, arm, mobile; did you mean 'arm'?"),
        ("move amr --home", "move: unknown object 'amr': known are floor, arm, mobile; did you mean 'arm'?"),
        ("move floor --home", "move: 'floor' is of type collision, expected a robot"),
        ("move arm lbr_iiwa_jont_2:=1", "move: unknown joint 'lbr_iiwa_jont_2': known are lbr_iiwa_joint_1,"),
        ("move arm lbr_iiwa_joint_2:=much", "move: expected a number, got much"),
        ("move arm lbr_iiwa_joint_2:=nan", "move: expected a number, got nan"),
        ("move arm 1 2", "move: expected JOINT:=POSITION ..., X Y Z, "),
        ("move arm", "move: expected JOINT:=POSITION ..., X Y Z, "),
        ("move arm 1 --home", "move: --home takes the name of a robot and nothing else"),
        ("send arm", "send: expected JOINT:=VALUE ...; the joints of 'arm' are lbr_iiwa_joint_1,"),
        ("send arm --drive 1 0 0", "send: 'arm' is of type robot, expected a robot with planar_base"),
        ("send arm a:=1 --push 1 0 0", "send: expected --drive, --push or targets of joints, got a:=1 as well"),
        ("attach amr floor", "attach: "),
        ("detach nothing", "detach: "),
        ("send floor --push 1 0 0", "send: 'floor/link0' is static, no force moves it"),
    ],
)
def test_impossible_commands_are_reported(say, line, told):
    code, text = say(line)
    assert code == 1
    assert text.startswith(told), text


def test_without_a_simulator_it_says_where_one_is(ros, monkeypatch):
    done = in_process("list")
    assert done.returncode == 1
    assert done.stderr == (
        f"list: no simulator runs without a namespace on the ROS master at {os.environ['ROS_MASTER_URI']}; "
        "there is one in /lab: use --ns\n"
    )
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    done = in_process("move", "box", "0", "0", "1")
    assert done.returncode == 1
    assert done.stderr.startswith(
        "move: no ROS master answers at http://127.0.0.1:1: start a simulator, for instance by"
    )


def test_the_namespace_may_be_that_of_the_process(ros, monkeypatch):
    monkeypatch.setenv("ROS_NAMESPACE", "lab")
    assert in_process("list").stdout.startswith("floor ")


def test_names_are_completed_in_bash(ros, tmp_path):
    kept = {name: os.environ[name] for name in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOME")}
    terminal = Terminal(tmp_path, ROS_NAMESPACE="lab", **kept)
    try:
        assert terminal.completed("./rpbi move mo\t") == "./rpbi move mobile"
        assert terminal.offered("./rpbi remove \t") == {"floor", "arm", "mobile"}
    finally:
        terminal.close()


def test_names_that_a_rogue_node_lists_run_nothing(ros, tmp_path):
    names = ["ball", "$(>canary)", "`>canary`", "x;>canary", "a'", "--help", "\x1b]0;x\x07", "b b"]
    rogue = rospy.Service("/rogue/rpbi/list_objects", ListObjects, lambda _: ListObjectsResponse(names, names))
    kept = {name: os.environ[name] for name in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOME")}
    terminal = Terminal(tmp_path, ROS_NAMESPACE="rogue", **kept)
    try:
        assert terminal.offered("./rpbi remove \t") == {"ball", "b"}
        assert "--help" not in terminal.shown("./rpbi remove \t")
        assert not (tmp_path / "canary").exists()
    finally:
        terminal.close()
        rogue.shutdown()


def test_foreign_names_reach_no_terminal_as_they_are(ros, tmp_path, capsys):
    names = ["\x1b]0;title\x07", "two\nlines"]
    rogue = rospy.Service("/rogue/rpbi/list_objects", ListObjects, lambda _: ListObjectsResponse(names, ["\x9b1m"] * 2))
    try:
        assert command_of("rpbi_utils.console.list").run(["--ns", "rogue"]) == 0
    finally:
        rogue.shutdown()
    assert capsys.readouterr().out == "\\x1b]0;title\\x07  \\x9b1m\ntwo\\x0alines      \\x9b1m\n"
    world = tmp_path / "world.yaml"
    world.write_text('{"timeStep": 0.01, "\\e]0;title\\a": 1}')
    assert command_of("rpbi.ros.console.check").run([str(world)]) == 1
    said = capsys.readouterr().err
    assert "title" in said and "\x1b" not in said


def test_kinds_are_known_by_their_keys():
    for world in CONFIGS.glob("*/config.yaml"):
        for item in load_world(str(world)).objects:
            assert BODY_TYPES[kind_in(load_config(item.path))].section == BODY_TYPES[item.type].section, item.path
    assert kind_in(load_config(str(CONFIGS / "pybullet_rgbd_example/config.yaml"))["rgbd_sensor"]) == "camera"
