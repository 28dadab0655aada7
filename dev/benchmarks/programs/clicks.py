"""Uses the controls window by mouse, and notes when the simulator and the window react.

Arguments: what `controls.py` prints into, the topic of the joint states, how many clicks and how many drags.
"""

from __future__ import annotations

import json
import random
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rospy
from sensor_msgs.msg import JointState

from ros_pybullet_interface.msg import WorldCommands

PATIENCE_S = 30.0
SILENCE_S = 0.3
"""Time without a joint state after which the world counts as stopped [s]."""
PAUSE_S = (0.1, 0.3)
"""Shortest and longest time before a click, so that it comes at any time between two redraws [s]."""
DRAG_PX, STEP_PX = 6, 2
"""Length of a drag, and of the steps in which the mouse moves."""


class Mouse:
    """The mouse of the display, moved by XTEST from a process that runs already."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(["xdotool", "-"], stdin=subprocess.PIPE, text=True)

    def do(self, command: str) -> float:
        """Does a command of xdotool, and returns the time before it [s]."""
        assert self._process.stdin is not None
        before_s = time.monotonic()
        self._process.stdin.write(f"{command}\n")
        self._process.stdin.flush()
        return before_s

    def press(self, x: int, y: int) -> None:
        """Goes somewhere and presses the button."""
        self.do(f"mousemove {x} {y}")
        time.sleep(random.uniform(*PAUSE_S))
        self.do("mousedown 1")
        time.sleep(0.05)

    def click(self, x: int, y: int) -> float:
        """Clicks somewhere, and returns the time before the button was let go, at which a window acts [s]."""
        self.press(x, y)
        return self.do("mouseup 1")


class Buttons:
    """The buttons of the window, as it prints them."""

    def __init__(self, path: Path) -> None:
        self._path = path
        (line,) = [each for each in self._lines() if each.startswith("places: ")]
        self.places: dict[str, tuple[int, int]] = json.loads(line.partition(": ")[2])

    def wait(self, name: str, is_enabled: bool, since_s: float) -> float:
        """Waits until a button can be used, or cannot, and returns since when, counted from a time [s]."""

        def change() -> float | None:
            words = [line.split() for line in self._lines()]
            times = [float(each[2]) for each in words if each[:2] == [name, str(int(is_enabled))] and len(each) == 3]
            return next((at_s - since_s for at_s in times if at_s >= since_s), None)

        return wait_for(change, f"{name} is {'' if is_enabled else 'not '}to be used")

    def _lines(self) -> list[str]:
        return self._path.read_text(errors="replace").split("\n")[:-1]


class Simulator:
    """Arrivals of joint states and commands of the simulator [s]."""

    def __init__(self, joint_states: str) -> None:
        self.joint_states: list[float] = []
        self.numbers: list[int] = []
        self._commands: list[float] = []
        rospy.Subscriber(joint_states, JointState, self._on_joint_state, tcp_nodelay=True)
        rospy.Subscriber("/rpbi/commands", WorldCommands, lambda _: self._commands.append(time.monotonic()))
        wait_for(lambda: self.joint_states or None, "joint states come")

    def _on_joint_state(self, message: JointState) -> None:
        self.joint_states.append(time.monotonic())
        self.numbers.append(message.header.seq)

    def stops(self, since_s: float) -> float:
        """Waits until the world has stopped, and returns the time of the stop after a given time [s]."""

        def change() -> float | None:
            last_s = self.joint_states[-1]
            return last_s - since_s if time.monotonic() - last_s > SILENCE_S else None

        return wait_for(change, "the world stands still")

    def starts(self, since_s: float) -> float:
        """Waits for the first joint state after a time, and returns when it came, counted from then [s]."""
        return wait_for(lambda: _first(self.joint_states, since_s), "the world runs")

    def is_commanded(self, since_s: float) -> float:
        """Waits for the first command after a time, and returns when it came, counted from then [s]."""
        return wait_for(lambda: _first(self._commands, since_s), "a command has come")


def wait_for(change: Callable[[], object], what: str) -> float:
    """Waits until a function returns something else than None, and returns it.

    Raises:
        TimeoutError: If it does not.
    """
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        found = change()
        if found is not None:
            return found  # type: ignore[return-value]
        time.sleep(0.005)
    raise TimeoutError(f"it did not come about that {what}")


def _first(times: list[float], since_s: float) -> float | None:
    """Returns the first of ascending times after another one, counted from that one; None if there is none."""
    index = int(np.searchsorted(times, since_s, side="right"))
    return times[index] - since_s if index < len(times) else None


def main() -> None:
    """Clicks Stop and Start in turn, then drags the slider and sends, and prints all times."""
    path, joint_states, clicks, drags = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    rospy.init_node("clicks", disable_rostime=True, disable_signals=True)
    buttons, simulator, mouse = Buttons(path), Simulator(joint_states), Mouse()
    found: dict[str, list[float]] = {name: [] for name in ("clicks", "shown", "drags", "sends")}
    for index in range(clicks):
        name, other = ("start", "stop") if index % 2 else ("stop", "start")
        at_s = mouse.click(*buttons.places[name])
        found["clicks"].append(simulator.starts(at_s) if index % 2 else simulator.stops(at_s))
        found["shown"].append(buttons.wait(other, True, at_s))
    x, y = buttons.places["slider"]
    for index in range(drags):
        step = -STEP_PX if index % 2 else STEP_PX
        mouse.press(x, y)
        first_s = mouse.do(f"mousemove {x + step} {y}")
        for moved in range(2 * STEP_PX, DRAG_PX + 1, STEP_PX):
            time.sleep(0.02)
            mouse.do(f"mousemove {x + moved * step // STEP_PX} {y}")
        x += DRAG_PX * step // STEP_PX
        mouse.do("mouseup 1")
        found["drags"].append(buttons.wait("send", True, first_s))
        at_s = mouse.click(*buttons.places["send"])
        found["sends"].append(simulator.is_commanded(at_s))
        buttons.wait("send", False, at_s)
    lost = int((np.diff(simulator.numbers) - 1).sum())
    print(f"result: {json.dumps({**found, 'lost': lost, 'received': len(simulator.numbers)})}")


if __name__ == "__main__":
    main()
