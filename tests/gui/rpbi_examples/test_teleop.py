"""Real key presses, mouse drags, and joystick and 6-D mouse by what stands in for them, move the arm of the example."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

import numpy as np
import pytest
import rosnode
import rospy
from ros_system import RosSystem, stop_group, wait_until
from sensor_msgs.msg import Joy
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from operator_node.emulators.spacenavd import SpacenavDaemon
from operator_node.parser import reconstruct_interface_log_msg
from rpbi_data import EpisodeFolder

SLOW_S = 120.0
REQUESTED, GUARDED, MEASURED = (
    "/guarded/joint_states/target",
    "/rpbi/kuka_lwr/joint_states/target",
    "/rpbi/kuka_lwr/joint_states",
)
TARGET, TIP = "teleop_target", "rpbi/kuka_lwr/end_effector_ball"
AWAY, RIGHT, UP = np.array([-1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
"""Directions of a person who stands behind the arm, in the world."""
MIDDLE = np.array([0.0, 0.0, 0.3])
"""Origin of the target in the world [m]."""
SPEED = "speed:=0.4"


@pytest.fixture(scope="module")
def example(ros_master, screen, tmp_path_factory) -> Iterator[RosSystem]:
    """The example, in which the arm is at its target."""
    system = RosSystem(tmp_path_factory.mktemp("teleop"))
    try:
        arguments = ("teleop.launch", "headless:=true", "ik_hz:=30", "logger:=true", SPEED)
        process = system.start(["roslaunch", "rpbi_examples", *arguments], **screen.environment)
        wait_until(lambda: "the arm tracks its target" in system.output(process), "the arm is there", SLOW_S)
        yield system
    finally:
        system.close()


@pytest.fixture(scope="module")
def position(example) -> Callable[[str], np.ndarray]:
    """Where a frame is in the world [m]."""
    buffer = example.listen_to_tf()

    def position(frame: str) -> np.ndarray:
        found = buffer.lookup_transform("rpbi/world", frame, rospy.Time(0)).transform.translation
        return np.array([found.x, found.y, found.z])

    wait_until(lambda: all(buffer.can_transform("rpbi/world", each, rospy.Time(0)) for each in (TARGET, TIP)), "TF")
    return position


@pytest.fixture(autouse=True)
def middle(example, position) -> None:
    """Each test begins in the middle of where the target may go: its way could end at a limit otherwise."""
    assert example.call("reset_teleop_transform_to_zero", Trigger).success

    def is_there() -> bool:
        output = example.output(example.processes[0])
        assert "halted" not in output, output
        return bool(np.linalg.norm(position(TIP) - MIDDLE) < 2e-3)

    wait_until(is_there, "the arm is in the middle", SLOW_S)


@pytest.fixture
def follows(example, position) -> Callable[[np.ndarray, Callable[[], object], Callable[[], object]], None]:
    """Moves a device until the arm has gone 4 cm in a direction, lets go, and sees it stand still at its target."""
    signals = example.listen("operator_node/signal", Float64MultiArray)

    def stands(before: list[np.ndarray]) -> bool:
        """Tells whether the tip is at its target, and was where it is when this was asked before."""
        before.append(position(TIP))
        return np.linalg.norm(before[-1] - before[-2]) < 5e-4 and np.linalg.norm(before[-1] - position(TARGET)) < 2e-3

    def run(direction: np.ndarray, move: Callable[[], object], let_go: Callable[[], object]) -> None:
        start = position(TIP)
        try:
            wait_until(lambda: move() or (position(TIP) - start) @ direction > 0.04, "the arm follows", SLOW_S)
        finally:
            let_go()  # else the next test would find a button held
        wait_until(lambda: signals.messages and not any(signals.messages[-1].data), "the signal is zero")
        seen = [start]  # it goes a little too far and comes back, since it cannot stop as suddenly as a key is let go
        wait_until(lambda: stands(seen), "the arm stands at its target", SLOW_S, every_s=0.3)
        way = position(TIP) - start
        assert np.linalg.norm(way - (way @ direction) * direction) < 5e-3, "it goes in no other direction"

    return run


@contextlib.contextmanager
def device(example, screen, name: str, *arguments: str, **environment: str) -> Iterator[None]:
    """Runs another device in the place of the one before; keyboard and device would both publish joy."""
    rosnode.kill_nodes(["/keyboard"])
    command = ["roslaunch", "operator_node", f"{name}.launch", SPEED, *arguments]
    process = example.start(command, **screen.environment, **environment)
    try:
        yield
    finally:
        stop_group(process)


def nothing() -> None:
    """Does nothing: the device is moved already."""


def test_keys_move_the_arm_and_both_guard_sides_are_recorded(example, screen, follows, tmp_path):
    recorder = example.start(["rosrun", "episodes", "record_node.py", f"_folder:={tmp_path}", "_disk_reserve_mb:=1.0"])
    wait_until(lambda: example.call("/record/start", Trigger).success, "it is recorded")
    screen.run("xdotool", "search", "--sync", "--name", "keyboard", "windowfocus", "--sync")
    for key, direction in (("Up", AWAY), ("Right", RIGHT), ("b", -UP)):
        screen.run("xdotool", "keydown", key)
        follows(direction, nothing, lambda: screen.run("xdotool", "keyup", key))  # noqa: B023 (it is called here)
    assert example.call("/record/stop", Trigger).success
    stop_group(recorder)
    recorded = EpisodeFolder(tmp_path).read(0).topics
    assert all(recorded[topic]["messages"] > 10 for topic in (REQUESTED, GUARDED, MEASURED))


def test_the_logger_has_the_signals_of_the_last_second(example, screen):
    windows = example.listen("operator_node/window", Float64MultiArray)
    screen.run("xdotool", "search", "--sync", "--name", "keyboard", "windowfocus", "--sync", "keydown", "Left")
    try:

        def has_them() -> bool:
            if not windows.messages:
                return False
            times_s, signals = reconstruct_interface_log_msg(windows.messages[-1], Nd=3)
            return 0.5 < times_s[-1] - times_s[0] <= 1.0 and bool((signals[0, -5:] < 0.0).all())

        wait_until(has_them, "the window has the signal to the left")
    finally:
        screen.run("xdotool", "keyup", "Left")


@pytest.mark.thorough
def test_two_keys_are_as_fast_as_one(example, screen):
    signals = example.listen("operator_node/signal", Float64MultiArray)
    screen.run("xdotool", "search", "--sync", "--name", "keyboard", "windowfocus", "--sync", "keydown", "Left")
    try:
        wait_until(lambda: any(signals.messages[-1].data), "a key moves it")
        assert np.linalg.norm(signals.messages[-1].data) == pytest.approx(0.4)
        screen.run("xdotool", "keydown", "f")
        wait_until(lambda: all(signals.messages[-1].data[::2]), "two keys move it")
        assert np.linalg.norm(signals.messages[-1].data) == pytest.approx(0.4)
    finally:
        screen.run("xdotool", "keyup", "Left", "keyup", "f")


def test_mouse_moves_the_arm(example, screen, follows):
    with device(example, screen, "mouse"):
        window = ("search", "--sync", "--onlyvisible", "--name", "^mouse$")  # before it is visible, it gets no mouse
        screen.run("xdotool", *window, "windowraise", "mousemove", "--window", "%1", "100", "200")
        screen.run("xdotool", "mousedown", "1", "mousemove_relative", "--", "-80", "0")
        follows(-RIGHT, nothing, lambda: screen.run("xdotool", "mouseup", "1"))


@pytest.mark.thorough
def test_joystick_moves_the_arm(example, screen, follows):
    with device(example, screen, "joystick", "virtual:=true"):
        stick, joy = rospy.Publisher("joy/virtual", Joy, queue_size=10), example.listen("joy", Joy)

        def hold(away: float) -> None:
            stick.publish(Joy(axes=[0.0, away, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0], buttons=[0] * 11))

        wait_until(lambda: hold(0.08) or (joy.messages and joy.messages[-1].axes[1]), "the stick has been at rest")
        follows(-AWAY, lambda: hold(-0.8), lambda: hold(0.0))
        stick.unregister()


@pytest.mark.thorough
def test_6d_mouse_moves_the_arm(example, screen, follows, tmp_path):
    cap = SpacenavDaemon(tmp_path / "spnav.sock")
    with device(example, screen, "spacenav", SPNAV_SOCKET=str(cap.path)):
        wait_until(lambda: cap.clients, "the node is connected")
        cap.move(0, 0, 0)  # what is pushed before it has been at rest does not count
        follows(UP, lambda: cap.move(0, 300, 0), lambda: cap.move(0, 0, 0))
    cap.close()


@pytest.mark.thorough
def test_virtual_haptic_device_moves_the_arm(example, screen, follows):
    with device(example, screen, "virtual"):
        window = ("search", "--sync", "--onlyvisible", "--name", "Virtual haptic device")
        screen.run("xdotool", *window, "windowraise")
        for button, right, down, direction in (("1", 60, 0, RIGHT), ("1", 0, 60, -AWAY), ("3", 0, -60, UP)):
            screen.run("xdotool", *window, "mousemove", "--window", "%1", "210", "210")
            screen.run("xdotool", "mousedown", button, "mousemove_relative", "--", str(right), str(down))
            follows(direction, nothing, lambda: screen.run("xdotool", "mouseup", button))  # noqa: B023 (called here)
