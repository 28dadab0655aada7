"""The controls window, by real clicks and keys, beside a simulator that comes and goes."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import rospy
import yaml
from controls_window import FILE, widgets
from ros_system import RosSystem, stop_group, wait_until
from screen import Screen
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger, TriggerResponse
from worlds import BOX_FLOOR, box, iiwa, write_world

from ros_pybullet_interface.msg import SimulationState
from rpbi_data import bag_to_dataframes

TITLE = "ROS-PyBullet Interface Controls"
CAMERA = {
    "name": "front",
    "object_tf": {"tf_id": "front"},
    "intrinsics": {"width": 160, "height": 120},
    "hz": 10,
}
POSES = [{"tf_id": "front", "position": [2.0, 0.0, 0.5], "rpy": [-1.57, 0.0, 1.57]}]


class Controls:
    """The window, a simulator beside it, and the hands of somebody who uses both."""

    def __init__(self, system: RosSystem, screen: Screen, folder: Path) -> None:
        self.system, self.screen, self.folder = system, screen, folder
        self._widgets = folder / "widgets.json"
        self.simulator: subprocess.Popen[bytes] | None = None
        self.world = write_world(
            folder,
            collision=(BOX_FLOOR,),
            dynamic=(box(basePosition=[0.0, 1.0, 0.1]),),
            robots=(iiwa(joint_state_publisher_hz=1000), iiwa("other", loadURDF=PLACED)),
            rgbd_sensor=CAMERA,
            poses=POSES,
            start_pybullet_after_initialization=False,
        )
        environment = {**screen.environment, FILE: str(self._widgets)}
        self.node = system.start_program("controls_window.py", "_view:=false", "_robot_name:=other", **environment)
        wait_until(lambda: "status" in self.widgets, "the window is open")
        self.screen.run("xdotool", "search", "--name", TITLE, "windowfocus")

    def start_simulator(self) -> None:
        config = yaml.safe_load(Path(self.world).read_text())
        for section in ("collision_objects", "dynamic_objects", "robots"):
            config[section] = [str(self.folder / file) for file in config[section]]
        self.simulator = self.system.simulator(config, use_sim_time=True, fresh=True)

    def have_running(self) -> None:
        """Starts a simulator and its world, unless an earlier test did."""
        if self.simulator is None:
            self.start_simulator()
        wait_until(lambda: self.text("status") in ("stopped", "running"), "the window sees the simulator")
        if self.text("status") == "stopped":
            self.click("start")
        self.wait_for("status", "running")

    @property
    def widgets(self):
        return widgets(self._widgets)

    def text(self, name: str) -> str:
        return self.widgets[name].text

    def place(self, name: str) -> tuple[int, int]:
        """Returns the middle of a widget on the screen [px]."""
        return self.widgets[name][:2]

    def is_enabled(self, *names: str) -> list[bool]:
        present = self.widgets
        return [name in present and present[name].is_enabled for name in names]

    def wait_for(self, name: str, text: str) -> None:
        try:
            wait_until(lambda: name in self.widgets and text in self.text(name), f"{name} shows '{text}'", 60.0)
        except TimeoutError as error:
            raise AssertionError(f"{error}: {self.widgets.get(name)}; {self.text('message')}") from error

    def click(self, name: str, share: float = 0.5) -> None:
        """Clicks on a widget, at a share of its width, once it can be used."""
        wait_until(lambda: self.is_enabled(name) == [True], f"{name} can be used")
        widget = self.widgets[name]
        column = widget.x + round((share - 0.5) * widget.width)
        self.screen.run("xdotool", "mousemove", str(column), str(widget.y), "click", "1")

    def type(self, name: str, text: str) -> None:
        self.click(name)
        self.screen.run("xdotool", "key", "ctrl+a", "type", text)
        self.screen.run("xdotool", "key", "Tab")

    def drag(self, name: str, to: float) -> None:
        """Drags the handle of a slider in the middle to a share of its width."""
        widget = self.widgets[name]
        column = widget.x + round((to - 0.5) * widget.width)
        start = ("mousemove", str(widget.x), str(widget.y), "mousedown", "1")
        self.screen.run("xdotool", *start, "mousemove", str(column), str(widget.y), "mouseup", "1")


CONSOLE = Path(__file__).resolve().parents[3] / "devel/lib/custom_ros_tools/console"
ENDED = re.compile(r"\[rpbi_controls_node-\d+\] process has died \[pid \d+, exit code (\d+),")
PLACED = {"fileName": "kuka_iiwa/model.urdf", "useFixedBase": True, "basePosition": [0.0, -1.0, 0.0]}
RUN = ("start", "step", "n_steps", "stop", "reset", "set_factor")


@pytest.fixture(scope="module")
def controls(module_ros, screen, tmp_path_factory):
    return Controls(module_ros, screen, tmp_path_factory.mktemp("controls"))


@pytest.mark.thorough
def test_world_key_opens_the_window_and_missing_displays_end_it(ros, tmp_path):
    world = write_world(tmp_path, visual=(), controls={"robot_name": "iiwa"})
    launch = ros.start([sys.executable, str(CONSOLE), "launch", str(world), "rviz:=false"], DISPLAY=":12345")
    ended = wait_until(lambda: ENDED.search(ros.output(launch)), "the window has ended")
    assert ended[1] == "1"
    (line,) = [each for each in ros.output(launch).splitlines() if "no display" in each]
    assert ":12345" in line and "xvfb-run" in line
    assert rospy.get_param("/rpbi_controls_node/robot_name") == "iiwa"


def test_without_a_simulator_nothing_can_be_pressed(controls):
    assert controls.text("status") == "no simulator"
    assert not any(controls.is_enabled(*RUN, "add", "remove", "record"))


def test_start_step_and_stop(controls):
    controls.start_simulator()
    controls.wait_for("status", "stopped")
    assert controls.is_enabled("start", "step", "n_steps", "stop") == [True, True, True, False]
    place = controls.place("record")
    controls.click("step")
    controls.wait_for("message", "Step: tick 1, stamp")
    assert controls.place("record") == place  # the message moved nothing
    controls.type("steps", "250")
    controls.click("n_steps")
    controls.wait_for("tick", "251")
    controls.click("start")
    controls.wait_for("status", "running")
    wait_until(lambda: controls.is_enabled("start", "step", "stop") == [False, False, True], "it can be stopped")
    controls.click("stop")
    controls.wait_for("status", "stopped")
    controls.click("reset")
    controls.wait_for("resets", "1")
    wait_until(lambda: controls.text("tick") == "0", "the world is at its first tick")


def test_real_time_factor_can_be_set_and_follows_other_clients(controls):
    controls.have_running()
    states = controls.system.listen("/rpbi/state", SimulationState)
    controls.type("factor", "0.5")
    controls.click("set_factor")
    wait_until(lambda: states.messages[-1].real_time_factor_asked == 0.5, "the pace is another one")
    controls.type("factor", "1")
    controls.click("set_factor")
    wait_until(lambda: states.messages[-1].real_time_factor_asked == 1.0, "the pace is that of before")
    states.close()


def test_a_slider_with_send_moves_the_robot(controls):
    joint = "lbr_iiwa_joint_2"
    controls.have_running()
    states = controls.system.listen("/rpbi/other/joint_states", JointState)
    controls.wait_for(f"measured {joint}", "rad")
    assert controls.is_enabled("send") == [False]
    place = controls.place(f"slider {joint}")
    controls.drag(f"slider {joint}", 0.7)
    wait_until(lambda: controls.is_enabled("send") == [True], "there is something to send")
    assert controls.place(f"slider {joint}") == place  # it stays under the mouse, although its name is bold
    goal = float(controls.text(f"target {joint}").removesuffix(" rad"))
    assert goal > 0.3
    controls.type("duration", "0.5")
    controls.click("send")
    index = states.wait_for()[-1].name.index(joint)
    wait_until(lambda: abs(states.messages[-1].position[index] - goal) < 0.01, "the robot is there")
    controls.wait_for("message", "Send of other")
    wait_until(lambda: controls.is_enabled("send") == [False], "the slider follows the joint again")
    shown = float(controls.text(f"measured {joint}").removesuffix(" rad"))
    assert abs(shown - goal) < 0.01
    controls.click("home")
    controls.wait_for("message", "Home of other")
    wait_until(lambda: abs(states.messages[-1].position[index]) < 0.01, "the robot is where it started")
    states.close()


def test_objects_are_removed_and_added(controls):
    controls.have_running()
    controls.wait_for("objects", "box dynamic")
    controls.click("objects/box")
    controls.click("remove")
    controls.wait_for("message", "Remove: ")
    wait_until(lambda: "box" not in controls.text("objects"), "the box is gone")
    controls.type("file", str(controls.folder / "box.yaml"))
    controls.type("name", "second")
    controls.click("add")
    controls.wait_for("objects", "second dynamic")
    controls.type("file", "/nowhere.yaml")
    controls.click("add")
    controls.wait_for("message", "nowhere.yaml")
    assert controls.node.poll() is None


def test_the_image_of_a_camera_is_shown(controls):
    controls.have_running()
    controls.click("camera")
    controls.screen.run("xdotool", "key", "Down", "Return")
    controls.wait_for("camera", "camera")
    wait_until(lambda: " x " in controls.text("image"), "there is an image")


def test_a_recording_with_a_label(controls, tmp_path):
    controls.have_running()
    controls.type("folder", str(tmp_path))
    controls.type("label", "push")
    controls.click("record")
    controls.wait_for("recording", " MB")
    controls.click("mark")
    controls.click("record")
    controls.wait_for("recording", "saved")
    (bag,) = tmp_path.glob("push_*.bag")
    frames = bag_to_dataframes(str(bag))
    assert list(frames["/rpbi_controls_node/label"]["data"]) == ["push"]
    assert len(frames["/rpbi/other/joint_states"]) > 0


def test_buttons_of_a_controller_call_its_services(controls):
    controls.have_running()
    assert "mpc_step" not in controls.widgets, "there is no controller"
    called, services = [], []
    for name in ("start", "step", "stop"):
        answer = TriggerResponse(True, f"answer of {name}")
        services.append(
            rospy.Service(f"/mpc/{name}", Trigger, lambda _, name=name, answer=answer: called.append(name) or answer)
        )
    try:
        for name in ("start", "step", "stop"):
            controls.click(f"mpc_{name}")
            controls.wait_for("message", f"MPC {name}: answer of {name}")
        assert called == ["start", "step", "stop"]
    finally:
        for service in services:
            service.shutdown()
    wait_until(lambda: "mpc_step" not in controls.widgets, "the buttons go with the controller")


def test_buttons_of_a_planner_call_its_services(controls):
    controls.have_running()
    assert "planner_plan" not in controls.widgets, "there is no planner"
    called, services = [], []
    for name in ("plan_to_frame", "move", "stop"):
        answer = TriggerResponse(True, f"answer of {name}")
        services.append(
            rospy.Service(
                f"/planner/{name}", Trigger, lambda _, name=name, answer=answer: called.append(name) or answer
            )
        )
    try:
        for title, name in (("Plan", "plan_to_frame"), ("Move", "move"), ("Stop", "stop")):
            controls.click(f"planner_{title.lower()}")
            controls.wait_for("message", f"{title}: answer of {name}")
        assert called == ["plan_to_frame", "move", "stop"]
    finally:
        for service in services:
            service.shutdown()


def test_window_causes_no_loss_of_joint_states(controls):
    controls.have_running()
    states = controls.system.listen("/rpbi/iiwa/joint_states", JointState)
    stamps = [message.header.stamp.to_nsec() for message in states.wait_for(2000)]
    states.close()
    assert {after - before for before, after in zip(stamps, stamps[1:])} == {1_000_000}


def test_buttons_go_grey_with_the_simulator_and_come_back(controls):
    controls.have_running()
    os.killpg(controls.simulator.pid, signal.SIGKILL)
    controls.wait_for("status", "no simulator")
    assert not any(controls.is_enabled(*RUN, "add", "remove", "send", "home"))
    controls.start_simulator()
    controls.wait_for("status", "stopped")
    wait_until(lambda: controls.is_enabled("start", "step") == [True, True], "it can be started")
    controls.click("start")
    controls.wait_for("status", "running")
    wait_until(lambda: controls.is_enabled("home") == [True], "the robot can be moved again")


def test_it_ends_on_ctrl_c(controls):
    assert stop_group(controls.node) == 0
