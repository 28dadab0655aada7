"""The window of live_plot: topics that come, change and go, by real keys and clicks."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import pandas as pd
import pytest
import rospy
from controls_window import FILE, MODULE, widgets
from node_world import publishing
from PIL import Image
from ros_system import RosSystem, find_executable, stop_group, wait_until
from screen import Screen
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Int16, String

WAVE, LATER = "/probe/states", "/probe/later"
FIELD = f"{WAVE}/position/left"
HZ, START_S = 200, 100.0
BLUE = (0x1F, 0x77, 0xB4)


def _value(time_s: float) -> float:
    return math.sin(3.0 * time_s)


class _Wave:
    """Publishes joint states whose stamps go on evenly, until it is closed."""

    def __init__(self) -> None:
        self._ended = Event()
        self._publisher = rospy.Publisher(WAVE, JointState, queue_size=10 * HZ)  # of a busy machine, none is lost
        Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        index = 0
        while not self._ended.wait(1.0 / HZ):
            stamp_s = START_S + index / HZ
            message = JointState(name=["right", "left"], position=[0.0, _value(stamp_s)])
            message.header.stamp = rospy.Time.from_sec(stamp_s)
            self._publisher.publish(message)
            index += 1

    def close(self) -> None:
        self._ended.set()
        self._publisher.unregister()


class _Window:
    """The window, and the hands of somebody who uses it."""

    def __init__(self, system: RosSystem, screen: Screen, folder: Path) -> None:
        self.system, self.screen, self.folder = system, screen, folder
        self._widgets = folder / "widgets.json"
        environment = {**screen.environment, FILE: str(self._widgets), MODULE: "rpbi_utils.live_plot.live_plot_node"}
        names = [f"{WAVE}/position/left", f"{WAVE}/positin[0]", LATER]
        self.node = system.start_program("controls_window.py", *names, "--out", str(folder), **environment)
        wait_until(lambda: "status" in self.widgets, "the window is open")
        screen.run("xdotool", "search", "--name", "Live plot", "windowfocus")

    @property
    def widgets(self) -> Any:
        return widgets(self._widgets)

    def press(self, key: str, message: str) -> None:
        """Presses a key once the window waits for one, and waits for the message."""
        self.screen.run("xdotool", "key", key)
        wait_until(lambda: message in self.widgets["message"].text, f"the window says '{message}'")

    def save(self, key: str, suffix: str) -> Path:
        """Returns the file that a key saves."""
        before = set(self.folder.glob(f"live_plot*.{suffix}"))
        self.screen.run("xdotool", "key", key)
        return wait_until(
            lambda: set(self.folder.glob(f"live_plot*.{suffix}")) - before, f"a {suffix} file is there"
        ).pop()

    def data(self) -> dict[str, pd.Series]:
        """Returns the lines that the window saves, by name."""
        table = pd.read_csv(self.save("d", "csv"))
        return {name: rows.set_index("time")["value"] for name, rows in table.groupby("field")}

    def wait_for_values(self, name: str) -> pd.Series:
        return wait_until(lambda: self.data().get(name), f"{name} is drawn", every_s=0.2)


@pytest.fixture(scope="module")
def window(module_ros: RosSystem, screen: Screen, tmp_path_factory: pytest.TempPathFactory) -> Iterator[_Window]:
    opened = _Window(module_ros, screen, tmp_path_factory.mktemp("live_plot"))
    wave = _Wave()
    yield opened
    wave.close()


def test_topic_published_later_is_drawn_as_sent(window: _Window) -> None:
    wait_until(lambda: len(window.data().get(FIELD, ())) > HZ, "a second is drawn", every_s=0.2)
    line = window.data()[FIELD]
    np.testing.assert_allclose(line, [_value(time_s) for time_s in line.index], atol=1e-6)
    np.testing.assert_allclose(np.diff(line.index), 1.0 / HZ, atol=1e-6)
    assert "redraws/s" in window.widgets["status"].text


def test_a_wrong_field_is_logged_once_in_one_line(window: _Window) -> None:
    lines = [line for line in window.system.output(window.node).splitlines() if "positin" in line]
    assert len(lines) == 1
    assert lines[0].endswith(
        "/probe/states (sensor_msgs/JointState): unknown field 'positin/0'; did you mean 'position/0'?"
    )


def test_a_topic_may_come_late_change_its_type_and_go(window: _Window) -> None:
    with publishing(LATER, Float64) as later:
        later.publish(Float64(3.5))
        wait_until(lambda: list(window.data().get(f"{LATER}/data", ())) == [3.5], "it is drawn", every_s=0.2)
    with publishing(LATER, Int16) as later:
        later.publish(Int16(-4))
        wait_until(lambda: list(window.data().get(f"{LATER}/data", ())) == [3.5, -4.0], "it goes on", every_s=0.2)
    with publishing(LATER, String) as later:
        later.publish(String("five"))
        wait_until(lambda: "std_msgs/String" in window.system.output(window.node), "text is no number")
    line = next(each for each in window.system.output(window.node).splitlines() if "std_msgs/String" in each)
    assert line.endswith(f"{LATER} (std_msgs/String): expected numbers, there are none in it")
    assert len(window.data()[FIELD]) > HZ and window.node.poll() is None


def test_the_picture_has_the_line(window: _Window) -> None:
    pixels = np.asarray(Image.open(window.save("p", "png")).convert("RGB"))
    is_blue = (pixels == BLUE).all(axis=2)
    assert is_blue.any(axis=0).mean() > 0.15  # of the columns: two seconds of ten at least, and the legend


def test_space_pauses_and_c_clears(window: _Window) -> None:
    window.press("space", "paused")
    held = window.data()[FIELD]
    time.sleep(0.3)  # in which the line would grow
    assert window.data()[FIELD].equals(held)
    window.press("space", "continues")
    wait_until(lambda: window.data()[FIELD].index[-1] > held.index[-1] + 0.2, "the line goes on", every_s=0.1)
    before_s = window.data()[FIELD].index[-1]
    button = window.widgets["clear"]
    window.screen.run("xdotool", "mousemove", str(button.x), str(button.y), "click", "1")
    wait_until(lambda: window.widgets["message"].text == "cleared", "the click clears")
    wait_until(lambda: FIELD in window.data() and window.data()[FIELD].index[0] > before_s, "only new samples are left")


def test_stamps_that_go_back_begin_anew(window: _Window) -> None:
    """As with a simulator that was started again."""
    again = _Wave()
    try:
        wait_until(lambda: window.data()[FIELD].index[-1] < START_S + 3.0, "the time is that of the start", every_s=0.2)
    finally:
        again.close()


def test_it_ends_on_ctrl_c(window: _Window) -> None:
    assert stop_group(window.node) == 0
    assert "Traceback" not in window.system.output(window.node)


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["/a/b"], 1, "no display for its window"),
        (["a b"], 2, "expected TOPIC/FIELD such as /arm/joint_states/position[0], got 'a b'"),
        (["/a/b", "--seconds", "0"], 2, "expected 0.5 to 120 seconds, got '0'"),
        ([], 2, "the following arguments are required: TOPIC/FIELD"),
    ],
)
def test_impossible_requests_are_named_in_one_line(ros: RosSystem, words: list[str], code: int, message: str) -> None:
    node = ros.start([find_executable("rpbi_utils", "live_plot"), *words], DISPLAY=":12345")
    assert node.wait(60.0) == code
    assert message in ros.output(node).splitlines()[-1]
