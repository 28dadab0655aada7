"""Controls of a world in a live view, while a script or a notebook steps the world."""

from __future__ import annotations

import math
import queue
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from typing import Any

from custom_ros_tools.errors import InterfaceError
from robot_model.geometry import Vector
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.bodies.robots.robot import Robot
from rpbi.world import World

from .controls import JointRange, NewObject
from .live_view import FRAMES_HZ, REFRESH_HZ
from .panel import COMMANDS
from .script_source import Due

LIMIT_S = 5.0
"""Time after which a request counts as unanswered [s]; requests are answered while the script steps the world."""


class WorldControls:
    """Controls of a world, see `Controls`. Requests are executed in the thread of the world, by `serve`."""

    adds_files = records = is_recording = False
    commands = COMMANDS

    def __init__(self, world: World) -> None:
        self._world = world
        self._requests: queue.SimpleQueue[tuple[Callable[[], str], Future[str]]] = queue.SimpleQueue()
        self._is_stopped = False
        self._ticks_left = 0
        self._factor = 0.0
        self._pace: tuple[float, float] | None = None
        """Wall time and simulated time from which the pace is measured [s]."""
        self._positions: dict[str, dict[str, float]] = {}
        self._ranges: dict[str, list[JointRange]] = {}
        self._objects: tuple[str, ...] = ()
        self._status = ""
        self._is_refresh_due = Due(REFRESH_HZ)

    @property
    def is_paused(self) -> bool:
        """Whether the world has to wait."""
        return self._is_stopped and not self._ticks_left

    def serve(self) -> None:
        """Executes all requests, and waits if the world is faster than the real-time factor."""
        while not self._requests.empty():
            call, future = self._requests.get()
            if future.set_running_or_notify_cancel():
                try:
                    future.set_result(call())
                except Exception as error:
                    future.set_exception(error)
        self._ticks_left = max(0, self._ticks_left - 1)
        if self._is_refresh_due():
            self._refresh()
        now_s, time_s = time.monotonic(), self._world.clock.time_s
        if not self._factor or self._is_stopped or self._pace is None or time_s < self._pace[1]:
            self._pace = now_s, time_s
            return
        ahead_s = (time_s - self._pace[1]) / self._factor - (now_s - self._pace[0])
        if ahead_s > 0.0:
            time.sleep(min(ahead_s, 1.0 / FRAMES_HZ))
        elif ahead_s < -1.0:  # too slow: does not catch up
            self._pace = now_s, time_s

    def _refresh(self) -> None:
        world = self._world
        robots = {name: body for name, body in world.bodies.items() if isinstance(body, JointedBody)}
        self._ranges = {
            name: [
                JointRange.of(joint.name, joint.lower, joint.upper, joint.is_revolute) for joint in body.model.driven
            ]
            for name, body in robots.items()
        }
        self._positions = {}
        for name, body in robots.items():
            names = {joint.index: joint.name for joint in body.joints}
            self._positions[name] = {names[index]: value for index, value in body.joint_positions().items()}
        self._objects = (*world.bodies, *world.cameras)
        state = "stopped at " if self._is_stopped else ""
        self._status = f"{state}{world.clock.time_s:.2f} s, tick {world.clock.tick}"

    def _ask(self, call: Callable[[], Any], text: str) -> str:
        future: Future[str] = Future()

        def do() -> str:
            call()
            return text

        self._requests.put((do, future))
        try:
            return future.result(LIMIT_S)
        except TimeoutError:
            future.cancel()
            raise InterfaceError("the script does not step the world now") from None
        except ValueError as error:
            raise InterfaceError(str(error)) from None

    def status(self) -> str:
        """Returns the time and the tick of the world."""
        return self._status

    def run(self, command: str) -> str:
        """Makes the script wait or continue, by a tick or until it is stopped, or resets the world."""
        if command == "Reset":
            return self._ask(lambda: self._world.reset(rebuild=False), "the world is reset")
        self._is_stopped = command != "Start"
        if command == "Step":
            return self.step(1)
        return "the script continues" if command == "Start" else "the script waits in World.step"

    def step(self, ticks: int) -> str:
        """Lets a waiting script make some steps."""
        if not self._is_stopped:
            raise InterfaceError("the script is running: stop it before stepping")
        return self._ask(lambda: setattr(self, "_ticks_left", ticks + 1), f"{ticks} ticks")

    def factor(self) -> float | None:
        """Returns the largest real-time factor; 0 is as fast as the script steps."""
        return self._factor

    def set_factor(self, factor: float) -> str:
        """Limits the real-time factor."""
        if not 0.0 <= factor < math.inf:
            raise InterfaceError(f"expected a factor of at least 0, got {factor:g}")
        self._factor, self._pace = factor, None
        return f"real-time factor at most {factor:g}" if factor else "as fast as the script steps"

    def robots(self) -> Sequence[str]:
        """Returns the names of all robots."""
        return sorted(self._ranges)

    def joints(self, robot: str) -> Sequence[JointRange]:
        """Returns the joints of a robot."""
        return self._ranges.get(robot, [])

    def positions(self, robot: str) -> Mapping[str, float]:
        """Returns the positions of joints."""
        return self._positions.get(robot, {})

    def move(self, robot: str, positions: Mapping[str, float], duration_s: float) -> str:
        """Starts a motion of a robot. A visual robot takes the positions at once."""
        body = self._world.bodies.get(robot)
        if isinstance(body, Robot):
            goal = {"positions": dict(positions), "duration_s": duration_s}
            return self._ask(lambda: self._world.act(robot, "move", goal), f"{robot} moves")
        return self._ask(lambda: self._world.act(robot, "set_joint_state", dict(positions)), f"{robot} is set")

    def home(self, robot: str, duration_s: float) -> str:
        """Starts a motion to where the joints started."""
        body = self._world.bodies.get(robot)
        if not isinstance(body, JointedBody):
            raise InterfaceError(f"{robot} is no robot")
        names = {joint.index: joint.name for joint in body.joints}
        return self.move(robot, {names[each]: at for each, at in body.start_positions().items()}, duration_s)

    def halt(self, robot: str) -> str:
        """Ends a motion."""
        return self._ask(lambda: self._world.act(robot, "stop_motion", "halted in the browser"), f"{robot} is halted")

    def objects(self) -> Sequence[str]:
        """Returns the names of all bodies and cameras."""
        return self._objects

    def add(self, primitive: NewObject) -> str:
        """Adds a primitive."""
        config = primitive.config()
        return self._ask(lambda: self._world.add("dynamic", config), f"{config['name']} is added")

    def remove(self, name: str) -> str:
        """Removes a body or a camera."""
        return self._ask(lambda: self._world.remove(name), f"{name} is removed")

    def add_file(self, file: str, name: str, position: Vector) -> str:
        """Not supported."""
        raise InterfaceError("a script adds files by World.add")

    def record(self, label: str) -> str:
        """Not supported."""
        raise InterfaceError("a script records by World.save")

    label = record

    def end_recording(self) -> str:
        """Not supported."""
        return self.record("")
