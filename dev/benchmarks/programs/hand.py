"""A hand that moves an emulated device of `teleop.launch` fast but plausibly; records status of guards and driver."""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
import rospy
from sensor_msgs.msg import JointState

from operator_node.emulators.spacenavd import FULL, SpacenavDaemon
from rpbi_utils.msg import DriverState
from safe_robot.msg import Status

START_S = 180.0
"""Longest time until the arm is at its target [s]."""
RESTS, TURNS = 0.2, 0.3
"""Probability of a rest, and of an additional rotation of the cap."""
RISES_S, HOLDS_S = (0.02, 0.1, 0.3, 0.6), (0.1, 1.5)
"""Time to push, and time for which it is held then."""
QUEUE_SIZE = 1000
GUARDS = {
    "/robot_safety/status": "the guard before the simulated arm",
    "/real_robot/robot_safety/status": "the guard before the driver",
}


class Device(ABC):
    """A device without a person.

    Attributes:
        step_s: Time between two of its motions [s].
    """

    step_s = 0.02

    @abstractmethod
    def move(self, share: Sequence[float]) -> None:
        """Moves to the right, away, up, and turns about these, each in [-1, 1]."""


class Cap(Device):
    """The cap of a 6-D mouse."""

    def __init__(self, socket: str) -> None:
        self._daemon = SpacenavDaemon(socket)

    def move(self, share: Sequence[float]) -> None:
        """See `Device`."""
        self._daemon.move(*(round(FULL * each) for each in share))


class Keys(Device):
    """Keys of the keyboard: one is held or not."""

    NAMES = (("Left", "Right"), ("Down", "Up"), ("b", "f"))

    def __init__(self, _: str) -> None:
        _xdotool("search", "--sync", "--name", "^keyboard$", "windowfocus")
        self._held: set[str] = set()

    def move(self, share: Sequence[float]) -> None:
        """See `Device`."""
        held = {pair[each > 0.0] for pair, each in zip(self.NAMES, share) if abs(each) > 0.5}
        for verb, keys in (("keyup", self._held - held), ("keydown", held - self._held)):
            if keys:
                _xdotool(verb, *sorted(keys))
        self._held = held


class Mouse(Device):
    """A mouse that is dragged in its window, and its wheel."""

    step_s = 0.04

    def __init__(self, _: str) -> None:
        found = _xdotool("search", "--sync", "--name", "^mouse$", "getwindowgeometry", "--shell")
        place = {key: int(value) for key, value in (line.split("=") for line in found.split())}
        self._middle = place["X"] + place["WIDTH"] // 2, place["Y"] + place["HEIGHT"] // 2
        self._half = 0.45 * place["WIDTH"], 0.45 * place["HEIGHT"]
        self._is_down = False

    def move(self, share: Sequence[float]) -> None:
        """See `Device`."""
        right, up, wheel = share[:3]
        x, y = round(self._middle[0] + right * self._half[0]), round(self._middle[1] - up * self._half[1])
        motion = ["mousemove", str(x), str(y)]
        if (is_down := bool(right or up)) != self._is_down:
            self._is_down = is_down
            press = ["mousemove", *map(str, self._middle), "mousedown", "1", *motion]
            motion = press if is_down else ["mouseup", "1"]
        if abs(wheel) > 0.9:
            motion += ["click", "4" if wheel > 0.0 else "5"]
        _xdotool(*motion)


DEVICES: dict[str, type[Device]] = {"spacenav": Cap, "keyboard": Keys, "mouse": Mouse}


class Witness:
    """Records the targets, and the status of the guards and of the driver."""

    def __init__(self, targets: str) -> None:
        self.targets: list[tuple[float, ...]] = []
        self.decisions = 0
        self.unsafe: list[str] = []
        self.driver = DriverState()
        self._subscribe(targets, JointState, lambda message: self.targets.append(message.position))
        for topic, guard in GUARDS.items():
            self._subscribe(topic, Status, partial(self._on_status, guard))
        self._subscribe("/stand_in/driver_state", DriverState, lambda message: setattr(self, "driver", message))

    @property
    def is_stopped(self) -> bool:
        """Whether a guard has refused a target, or the driver has stopped."""
        return bool(self.unsafe or self.driver.reflexes)

    def _subscribe(self, topic: str, kind: type, on_message: object) -> None:
        rospy.Subscriber(topic, kind, on_message, queue_size=QUEUE_SIZE, tcp_nodelay=True)

    def _on_status(self, guard: str, message: Status) -> None:
        self.decisions += 1
        if not message.is_safe:
            self.unsafe.append(f"{message.message} ({guard})")


def main() -> None:
    """Moves the device until its time is over, or the arm is stopped; prints the result as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("device", choices=DEVICES)
    parser.add_argument("seconds", type=float)
    parser.add_argument("seed", type=int)
    parser.add_argument("targets", help="topic of the targets")
    parser.add_argument("file", help="where the targets go")
    parser.add_argument("--socket", default="", help="where the 6-D mouse is served")
    arguments = parser.parse_args()
    rospy.init_node("hand", anonymous=True, disable_signals=True)
    device, witness = DEVICES[arguments.device](arguments.socket), Witness(arguments.targets)
    begin_s = time.monotonic()
    while len(witness.targets) < 10 or not witness.driver.commands:
        if time.monotonic() > begin_s + START_S:
            raise RuntimeError("the arm does not follow")
        time.sleep(0.1)
    begin_s = time.monotonic()
    for share in _motions(random.Random(arguments.seed), device.step_s):
        if witness.is_stopped or time.monotonic() > begin_s + arguments.seconds:
            break
        device.move(share)
        time.sleep(device.step_s)
    device.move((0.0,) * 6)
    seconds = time.monotonic() - begin_s
    driver = witness.driver
    np.save(arguments.file, np.array(witness.targets))
    found = {"seconds": seconds, "targets": len(witness.targets), "decisions": witness.decisions}
    found |= {"unsafe": witness.unsafe, "commands": driver.commands, "reflex": driver.message}
    found |= {f"peak_{each}": getattr(driver, f"peak_{each}") for each in ("velocity", "acceleration", "jerk")}
    print("result:", json.dumps(found))


def _motions(chance: random.Random, step_s: float) -> Iterator[list[float]]:
    """Yields positions of the device step by step: minimum jerk from push to push, or rest."""
    now = [0.0] * 6
    while True:
        goal = [0.0] * 6
        if chance.random() > RESTS:
            for axis in chance.sample(range(3), chance.choice((1, 1, 2, 3))):
                goal[axis] = chance.uniform(0.3, 1.0) * chance.choice((-1.0, 1.0))
            if chance.random() < TURNS:
                goal[chance.randrange(3, 6)] = chance.uniform(-1.0, 1.0)
        steps = max(1, round(chance.choice(RISES_S) / step_s))
        for step in range(1, steps + 1):
            t = step / steps
            way = t**3 * (10.0 - 15.0 * t + 6.0 * t * t)
            yield [start + way * (end - start) for start, end in zip(now, goal)]
        now = goal
        yield from [goal] * round(chance.uniform(*HOLDS_S) / step_s)


def _xdotool(*arguments: str) -> str:
    return subprocess.run(["xdotool", *arguments], check=True, stdout=subprocess.PIPE, text=True).stdout


if __name__ == "__main__":
    main()
