"""`lfd_person.py`: a simulated person who demonstrates a push with keys. The node publishes the same messages as the
keyboard node, or presses keys in the window of the keyboard node.
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable

import numpy as np
import rospy
from keyboard.msg import Key
from std_msgs.msg import Header, String

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.ros.lifecycle.run_node import run_node
from custom_ros_tools.ros.tf_interface import TfInterface

from .arm_topics import ORIGIN, TIP, planar
from .box_services import FRAME, GOAL
from .person import Direction, Person

LOOK_HZ = 50.0
NEXT_KEY = {
    "ready": "1",
    "home": "2",
    "missed": "2",
    "demonstrating": "2",
    "demonstrated": "3",
    "learned": "3",
    "executed": "3",
}
"""Key to press, indexed by the state of `run_lfd.py`."""
DEMONSTRATING, DEMONSTRATE = "demonstrating", "2"
MAX_TRIES = 4
MAX_ANSWER_S = 5.0
"""Time after which a key that had no effect is pressed again [s]."""
PRESS_S = 0.1
"""Time for which a key is pressed [s]."""


Send = Callable[[bool, str], None]
"""Function that presses a key (True) or releases a key (False). The second argument is the key's name."""


class ScriptedPerson:
    """Operates `run_lfd.py`: presses the key that the node's state requires, and pushes the box in demonstrations.

    Args:
        send: Function that presses and releases keys.
    """

    def __init__(self, send: Send) -> None:
        self._send = send
        self._tf = TfInterface()
        self._random = np.random.default_rng([rospy.get_param("~seed", 0), 1])
        self._state = ""
        rospy.Subscriber("lfd/state", String, self._on_state)

    def run(self) -> None:
        """Operates `run_lfd.py` until ROS shuts down.

        Raises:
            InterfaceError: If `MAX_TRIES` demonstrations did not bring the box to its goal.
        """
        goal, tries = planar(self._tf.wait_for_tf_msg(ORIGIN, GOAL)), 0
        speed = rospy.get_param("operator_node/config/scale")
        while not rospy.is_shutdown():
            state = self._wait_for_state()
            if state == DEMONSTRATING:
                demonstrate(self._tf, Person(goal, speed, self._random), self._hold)
            tries += NEXT_KEY[state] == DEMONSTRATE and state != DEMONSTRATING
            if tries > MAX_TRIES:
                raise InterfaceError(f"the demonstration did not succeed, {MAX_TRIES} times")
            self._press(NEXT_KEY[state])
            self._wait_for_change(state)

    def _on_state(self, message: String) -> None:
        self._state = message.data

    def _wait_for_state(self) -> str:
        """Waits until `run_lfd.py` is in a state that expects a key press, and returns the state."""
        rate = rospy.Rate(LOOK_HZ)
        while (state := self._state) not in NEXT_KEY:
            rate.sleep()
        return state

    def _wait_for_change(self, state: str) -> None:
        deadline = rospy.get_time() + MAX_ANSWER_S
        rate = rospy.Rate(LOOK_HZ)
        while self._state == state and rospy.get_time() < deadline:
            rate.sleep()

    def _press(self, key: str) -> None:
        self._send(True, key)
        rospy.sleep(PRESS_S)
        self._send(False, key)

    def _hold(self, down: Direction | None, up: Direction | None) -> None:
        """Releases the arrow key `up`, and presses the arrow key `down`. None: no key."""
        if up is not None:
            self._send(False, up.name)
        if down is not None:
            self._send(True, down.name)


def key_topics() -> Send:
    """Returns a function that publishes key presses and releases with the same messages as the keyboard node."""
    topics = {
        is_down: rospy.Publisher(f"~{name}", Key, queue_size=100)
        for is_down, name in ((True, "keydown"), (False, "keyup"))
    }

    def send(is_down: bool, key: str) -> None:
        topics[is_down].publish(Key(header=Header(stamp=rospy.Time.now()), code=getattr(Key, f"KEY_{key}")))

    return send


def window_keys() -> Send:
    """Returns a function that presses and releases keys in the window of the keyboard node, with xdotool.

    Raises:
        InterfaceError: If xdotool fails.
    """

    def xdotool(*arguments: str) -> None:
        try:
            subprocess.run(["xdotool", *arguments], check=True, capture_output=True, text=True)
        except (OSError, subprocess.CalledProcessError) as error:
            raise InterfaceError(f"xdotool {' '.join(arguments)}: {error}") from error

    xdotool("search", "--sync", "--name", "keyboard", "windowfocus", "--sync")
    return lambda is_down, key: xdotool("keydown" if is_down else "keyup", key.capitalize())


def demonstrate(tf: TfInterface, person: Person, hold: Callable[[Direction | None, Direction | None], None]) -> None:
    """Runs a demonstration, and returns when the person is done.

    Args:
        tf: Access to TF, from which the person observes tip and box.
        person: The simulated person.
        hold: Called when the held key changes. Its arguments are the key to press and the key to release; None: no key.
    """
    held: Direction | None = None
    rate = rospy.Rate(LOOK_HZ)
    while not person.is_done:
        tip, box = (tf.wait_for_tf_msg(ORIGIN, frame) for frame in (TIP, FRAME))
        assert tip is not None and box is not None
        at = planar(tip)
        key = person.key(tip.header.stamp.to_sec(), (at.x, at.y), planar(box))
        if key is not held:
            hold(key, held)
            held = key
        rate.sleep()


def main() -> None:
    """Runs the node. With `~window`, the node presses keys in the keyboard's window instead of publishing the keys."""
    run_node("lfd_person", _act)


def _act() -> None:
    ScriptedPerson(window_keys() if rospy.get_param("~window", False) else key_topics()).run()
