"""`lfd.launch` by devices with sticks, and where it cannot begin.

Whole sessions by keys are in `tests/gui/rpbi_examples/test_lfd.py`, scripted ones in `./rpbi bench lfd`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Point, Vector3, Wrench
from node_world import registrations
from real_robot import RealRobot
from ros_system import RPBI, wait_until
from sensor_msgs.msg import Joy
from std_msgs.msg import String
from std_srvs.srv import Trigger

from custom_ros_tools.ros.tf_interface import TfInterface
from custom_ros_tools.transforms import Array
from operator_node.emulators.spacenavd import SpacenavDaemon
from ros_pybullet_interface.srv import ApplyWrench
from rpbi_data import EpisodeFolder, bag_to_dataframes
from rpbi_utils.msg import DriverState
from safe_robot.msg import Violation

FAST = "real_time_factor:=0"
ORIGIN, TIP = "rpbi/teleop_origin", "rpbi/kuka_lwr/end_effector_ball"


@pytest.mark.thorough
def test_a_goal_out_of_reach_is_named(ros, tmp_path):
    arguments = ("operator:=scripted", "headless:=true", f"out:={tmp_path}", "goal:=-1.6 0", FAST)
    process = ros.start([RPBI, "launch", "lfd", *arguments])
    wait_until(lambda: process.poll() is not None, "it ends by itself", 400.0)
    output = ros.output(process)
    assert "demonstrate: the goal is out of reach: 'end_effector_ball' misses its target by" in output
    assert "Traceback" not in output
    assert process.returncode == 1
    assert not (tmp_path / "summary.json").exists()


@pytest.mark.thorough
def test_a_demonstration_is_learned_by_exotica_and_the_dmp_services(ros, tmp_path):
    """A scripted person shows the push; the box is at its goal after an execution from a random start."""
    choice = ("ik:=exotica", "dmp:=server", "goal:=-0.73 0", "real_time_factor:=0.5")
    arguments = ("operator:=scripted", "headless:=true", "seed:=5", f"out:={tmp_path}", *choice)
    process = ros.start([RPBI, "launch", "lfd", *arguments])
    wait_until(lambda: process.poll() is not None, "it ends by itself", 400.0)
    output = ros.output(process)
    assert process.returncode == 0, output
    assert "started with pid" in output and "dmp_server" in output
    (executed,) = json.loads((tmp_path / "summary.json").read_text())["executions"]
    assert executed["at_goal"] and executed["box_error_m"] < 0.03


class Gamepad:
    """A virtual gamepad; pushed, its left stick is to the right and away."""

    button = 1

    def __init__(self, _: Path) -> None:
        self._topic = rospy.Publisher("joy/virtual", Joy, queue_size=10)

    def put(self, share: float, is_pressed: bool = False) -> None:
        buttons = [int(is_pressed and index == self.button) for index in range(11)]
        self._topic.publish(Joy(axes=[-share, share, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0], buttons=buttons))

    def close(self) -> None:
        self._topic.unregister()


class Cap:
    """A 6-D mouse; pushed, its cap is to the right, up and away, and turned about all axes."""

    button = 0

    def __init__(self, socket: Path) -> None:
        self._daemon = SpacenavDaemon(socket)
        self.close = self._daemon.close

    def put(self, share: float, is_pressed: bool = False) -> None:
        self._daemon.move(*[round(share * 512)] * 6)
        self._daemon.press(self.button, is_pressed)


@pytest.fixture(params=[("joystick", Gamepad), ("spacenav", Cap)], ids=lambda param: param[0])
def device(request, tmp_path) -> Iterator[tuple[str, Gamepad | Cap]]:
    """The operator of the launch file, and what moves its device."""
    operator, kind = request.param
    made = kind(tmp_path / "spnav.sock")
    yield operator, made
    made.close()


@pytest.mark.thorough
def test_a_device_demonstrates_in_the_plane(ros, tmp_path, device):
    """Its button starts and ends the demonstration; the tip moves in x and y alone, and keys stop no recording."""
    operator, stick = device
    arguments = (f"operator:={operator}", "virtual:=true", "headless:=true", f"out:={tmp_path}", FAST)
    ros.start(["roslaunch", "rpbi_examples", "lfd.launch", *arguments], SPNAV_SOCKET=str(tmp_path / "spnav.sock"))
    states, tf, joy = ros.listen("/lfd/state", String), ros.listen_to_tf(), ros.listen("/joy", Joy)

    def tip() -> Array:
        return TfInterface.msg_to_matrix(tf.lookup_transform(ORIGIN, TIP, rospy.Time(0)))

    def hold_until(condition: Callable[[], object], what: str, share: float = 0.0, is_pressed: bool = False) -> None:
        wait_until(lambda: stick.put(share, is_pressed) or condition(), what)

    hold_until(lambda: joy.messages and states.messages[-1].data == "ready", "the lesson and its device are ready")
    hold_until(lambda: states.messages[-1].data == "demonstrating", "the button starts it", is_pressed=True)
    start = tip()
    hold_until(lambda: (tip() - start)[:2, 3].min() > 0.03, "the tip moves", share=0.6)
    hold_until(lambda: not any(joy.messages[-1].axes[:2]), "the stick is at rest")
    end = tip()
    assert abs(end - start)[2, 3] < 0.005, "it keeps its height"
    assert np.linalg.norm((end - start)[:3, :3]) < 0.02, "and does not tilt"
    assert ("subscribes", "/keyboard/keydown") not in registrations("/record"), "keys end no episode"
    hold_until(lambda: states.messages[-1].data == "missed", "the button ends it", is_pressed=True)

    (episode,) = (folder := EpisodeFolder(tmp_path / "episodes")).all()
    assert (episode.state, episode.label) == ("complete", "failure")
    recorded = bag_to_dataframes(folder.folder_of(episode.number) / "episode.bag", "/joy")["/joy"]
    assert recorded[f"buttons/{stick.button}"].any() and recorded["axes/0"].any()


@pytest.mark.alone
@pytest.mark.thorough
@pytest.mark.parametrize("guard", [True, False])
def test_real_robot_follows_until_it_feels_more_than_it_may(ros, tmp_path, guard):
    violations = ros.listen("/real_robot/robot_safety/violation", Violation)
    driver, real = ros.listen("/stand_in/driver_state", DriverState), RealRobot(ros)
    device = ["operator:=joystick", "virtual:=true", "headless:=true", f"out:={tmp_path}"]
    launched = [*device, "real_robot:=true", f"guard:={str(guard).lower()}"]
    process = ros.start(["roslaunch", "rpbi_examples", "lfd.launch", *launched])
    wait_until(lambda: "key 1: home" in ros.output(process), "the lesson is ready")
    assert ros.call("/lfd/home", Trigger).success
    real.wait_until_moved()

    push, tool = Wrench(force=Vector3(0.0, 0.0, 120.0)), "kuka_lwr/end_effector_ball"
    assert ros.call("/stand_in/rpbi/apply_wrench", ApplyWrench, tool, push, Point(), "world", 0.0).success
    if guard:
        wait_until(lambda: any(each.check == "force" for each in list(violations.messages)), "the force is too large")
        wait_until(lambda: len({each.commands for each in driver.messages[-20:]}) == 1, "no command comes any more")
    else:
        commands = driver.messages[-1].commands
        wait_until(lambda: driver.messages[-1].commands > commands + 100, "it follows all the same")
