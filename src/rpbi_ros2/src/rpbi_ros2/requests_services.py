"""Answers requests of the companion: services and actions of the simulator for programs with ROS 2.

A request and its answer are JSON on two topics of ROS 2, with the number of the request:

    {"id": "1", "call": "step", "arguments": {"steps": 100}}
    {"id": "1", "success": true, "message": "tick 100, stamp 0.1"}

A motion along a trajectory sends feedback before its answer: `{"id": "2", "feedback": {...}}`. `cancel` ends it.
"""

from __future__ import annotations

import json
import tempfile
import threading
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import rospy
from std_msgs.msg import Int64
from std_srvs.srv import Trigger

from custom_ros_tools.errors import InterfaceError
from custom_ros_tools.transforms import rpy_of
from ros_pybullet_interface.srv import StepN
from rpbi_utils.console.move import move
from rpbi_utils.console.remove import remove
from rpbi_utils.console.restore import restore
from rpbi_utils.console.running_simulator import RunningSimulator
from rpbi_utils.console.save import save
from rpbi_utils.console.spawn import spawn

from .trajectory_action import RequestedMotion

REQUEST, RESPONSE = "rpbi/ros2/request", "rpbi/ros2/response"
"""Names of the two topics, relative to the bridge's namespace."""
MAX_BYTES = 1 << 20
"""Largest size of a request [bytes]; a trajectory with 1,000 points of seven joints has 0.4 MB."""
MAX_ANSWERED = 100
"""Largest number of answers that are kept for repeated requests."""
MAX_RUNNING = 32
"""Largest number of requests that run at the same time."""
STATUS_S = 3.0
"""Longest time to wait for the simulator's status [s]."""
Answer = dict[str, Any]


class CompanionRequests:
    """Runs requests, each in its own thread.

    Args:
        respond: Function that sends an answer, as JSON.
    """

    def __init__(self, respond: Callable[[str], None]) -> None:
        self._respond = respond
        self._running: dict[str, RequestedMotion | None] = {}
        self._answered: dict[str, Answer] = {}
        self._lock = threading.Lock()

    def accept(self, text: bytes) -> None:
        """Begins to run a request; one that has come before is not run again, since programs repeat requests.

        Raises:
            ValueError: If the request is invalid.
        """
        number, name, arguments = _parsed(text)
        if name == "cancel":
            motion = self._running.get(number)
            if motion is not None:
                motion.cancel()
            return
        if number in self._answered:  # the answer was lost
            self._answer(number, self._answered[number])
            return
        if number in self._running:
            return
        if name not in CALLS and name != "follow":
            self._answer(number, _failure(f"unknown call '{name[:40]}'; known are {', '.join([*CALLS, 'follow'])}"))
            return
        with self._lock:
            if len(self._running) >= MAX_RUNNING:
                raise ValueError(f"{MAX_RUNNING} others run")
            motion = RequestedMotion(lambda feedback: self._answer(number, feedback)) if name == "follow" else None
            self._running[number] = motion
        call = CALLS[name] if motion is None else motion.run
        threading.Thread(target=self._run, args=(number, call, arguments), name=name, daemon=True).start()

    def _run(self, number: str, call: Callable[..., Answer], arguments: dict[str, Any]) -> None:
        try:
            answer = call(**arguments)
        except (InterfaceError, rospy.ROSException, rospy.ServiceException, OSError) as error:
            answer = _failure(str(error))
        except (TypeError, ValueError, KeyError, AttributeError) as error:  # wrong arguments
            answer = _failure(f"{type(error).__name__}: {error}")
        finally:
            with self._lock:
                del self._running[number]
        self._answered[number] = answer
        if len(self._answered) > MAX_ANSWERED:
            del self._answered[next(iter(self._answered))]
        self._answer(number, answer)

    def _answer(self, number: str, answer: Answer) -> None:
        self._respond(json.dumps({"id": number, **answer}))


def _parsed(text: bytes) -> tuple[str, str, dict[str, Any]]:
    if len(text) > MAX_BYTES:
        raise ValueError(f"{len(text):,} bytes: expected at most {MAX_BYTES:,}")
    try:
        request = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"no JSON: {error}") from None
    match request:
        case {"id": str(number), "call": str(name), "arguments": dict(arguments)}:
            return number, name, arguments
    raise ValueError('expected {"id": "...", "call": "...", "arguments": {...}}')


def _failure(message: str) -> Answer:
    return {"success": False, "message": message}


def _success(message: str, **more: Any) -> Answer:
    return {"success": True, "message": message, **more}


def _trigger(name: str) -> Callable[[], Answer]:
    def call() -> Answer:
        answer = rospy.ServiceProxy(name, Trigger)()
        return {"success": answer.success, "message": answer.message}

    return call


def _step(steps: int = 1) -> Answer:
    answer = rospy.ServiceProxy("rpbi/step_n", StepN)(steps)
    return {"success": answer.success, "message": answer.message}


def _state() -> Answer:
    is_running = bool(rospy.wait_for_message("rpbi/status", Int64, STATUS_S).data)
    return _success("running" if is_running else "stopped", running=is_running)


def _objects() -> Answer:
    simulator = RunningSimulator()
    objects = simulator.objects()
    return _success(", ".join(objects), objects=objects, robots=[name for name in objects if _follows(simulator, name)])


def _follows(simulator: RunningSimulator, name: str) -> bool:
    try:
        simulator.require(name, "joint_trajectory_controller/command", "a robot")
    except InterfaceError:
        return False
    return True


def _spawn(entity: str = "", uri: str = "", name: str = "", pose: list[float] | None = None) -> Answer:
    """Adds an object.

    Args:
        entity: URDF, or YAML of the object; empty: `uri` is used.
        uri: Path of a file with such text on the simulator's computer, which may begin with `file://`.
        name: Name of the object; empty: the name in the file.
        pose: Position [m] and quaternion x, y, z, w.
    """
    at, rpy = (None, None) if pose is None else (pose[:3], list(rpy_of(pose[3:])))
    if not entity:
        return _success(spawn(uri.removeprefix("file://"), name=name or None, at=at, rpy=rpy))
    suffix = ".urdf" if entity.lstrip().startswith("<") else ".yaml"
    with tempfile.NamedTemporaryFile("w", suffix=suffix, dir=_folder().name, delete=False) as file:
        file.write(entity)
    return _success(spawn(file.name, name=name or None, at=at, rpy=rpy))


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Makes the folder of files that the simulator reads, which lasts as long as the bridge."""
    return tempfile.TemporaryDirectory(prefix="rpbi_ros2_")


def _move(name: str, pose: list[float]) -> Answer:
    return _success(move(name, *map(repr, (*pose[:3], *rpy_of(pose[3:])))))


CALLS: dict[str, Callable[..., Answer]] = {
    **{name: _trigger(f"rpbi/{name}") for name in ("start", "stop", "reset")},
    "step": _step,
    "state": _state,
    "list": _objects,
    "spawn": _spawn,
    "move": _move,
    "remove": lambda name: _success(remove(name)),
    "save": lambda file: _success(save(Path.home() / file)),
    "restore": lambda file: _success(restore(Path.home() / file)),
}
"""Functions that requests call, by name."""
