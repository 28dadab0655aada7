"""Starts the renderer process from the simulator, and exchanges messages with it."""

import logging
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from custom_ros_tools.child_process import is_stopped, python_module
from rpbi.samples import SceneSample
from rpbi.world.load_log import LoadLogReader, LogEntry

from .channel import (
    Alive,
    CameraAdded,
    CameraRemoved,
    Channel,
    Demanded,
    DrawnScene,
    Ready,
    Report,
    SceneAccepted,
    SetUp,
    Shown,
    WorldChanged,
)
from .frame import NO_DEMAND, Camera, Demand

log = logging.getLogger(__name__)

LONGEST_PAUSE_S = 30.0
STABLE_AFTER_S = 10.0
STOP_TIMEOUT_S = 2.0
"""Longest wait [s] for the end of a renderer that is ready; a renderer that still starts does not listen."""
SILENT_AFTER_S = 5.0
"""Longest time [s] without a message from a renderer that is ready; beyond it, a warning is logged."""


class RenderClient:
    """Runs the renderer process and sends scenes to the process; only the methods `wait` and `stop` block.

    The process starts with the first camera. Until the renderer has accepted a sent scene, only the newest later scene
    of the same camera is kept, to be sent next. Only the simulation thread may call the methods.

    Args:
        cameras: The initial cameras.
        load_log: The world's load log, which may grow at any time; all entries are sent to the process.
        body_ids: Returns the simulator's PyBullet ids of all bodies, indexed by name.
        sink: Factory of the object that receives frames in the renderer process, as `module:factory`; see `frame.Sink`.
        arguments: Further command-line arguments of the process, for the sink.
        use_egl: Whether to try the fast EGL renderer before the software renderer.
    """

    def __init__(
        self,
        cameras: Sequence[Camera],
        load_log: Sequence[LogEntry],
        body_ids: Callable[[], Mapping[str, int]],
        sink: str,
        arguments: Sequence[str] = (),
        use_egl: bool = True,
    ) -> None:
        self.wanted: frozenset[str] = frozenset()
        """Names of the cameras whose images have viewers."""
        self.renderer = ""
        """Name of the renderer, empty until it is ready."""
        self._cameras = {camera.name: camera for camera in cameras}
        self._log = load_log
        self._body_ids = body_ids
        self._command = python_module("rpbi.render", "--sink", sink, *arguments)
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: Channel | None = None
        self._use_egl = use_egl
        self.fault = ""
        """Why the renderer does not answer; empty if the renderer answers."""
        self._heard_s = 0.0
        self._started_s = 0.0
        self._start_at_s = 0.0
        self._failures = 0
        self._last: dict[str, DrawnScene] = {}
        self._forget()
        self._do: dict[type, Callable[[Any], None]] = {
            Ready: self._on_ready,
            Alive: lambda _: None,
            SceneAccepted: self._on_scene_accepted,
            Shown: self._on_shown,
            Demanded: self._on_demanded,
            Report: lambda report: log.log(report.level, "camera: %s", report.text),
        }

    @property
    def process_id(self) -> int | None:
        """Id of the renderer process; None while the process is not running."""
        return None if self._process is None else self._process.pid

    def poll(self) -> None:
        """Starts the process if necessary, also after a failure, and handles the process's messages.

        Call this method in every pass of the simulation loop.
        """
        if self._channel is None:
            if self._process is not None:
                self._bury()
            elif self._cameras and time.monotonic() >= self._start_at_s:
                self._start()
            return
        self._channel.flush()
        messages = self._channel.receive()
        for message in messages:
            self._do[type(message)](message)
        self._watch(is_heard=bool(messages) or not self.renderer)
        if self._channel.closed:
            self._channel.close()
            self._channel = None
            self._forget()

    def add(self, camera: Camera) -> None:
        """Adds a camera."""
        self._cameras[camera.name] = camera
        if self._channel is not None:
            self._channel.send(CameraAdded(camera))

    def remove(self, name: str) -> None:
        """Removes a camera."""
        del self._cameras[name]
        for known in (self._demands, self._waiting, self._last, self._served, self._shown_ns):
            known.pop(name, None)
        self._under_way.discard(name)
        self.wanted -= {name}
        if self._channel is not None:
            self._channel.send(CameraRemoved(name))

    def knows_demand(self, name: str) -> bool:
        """Returns whether the renderer process has reported the demand for a camera's images."""
        return name in self._demands

    def has_shown(self, name: str, stamp_ns: int) -> bool:
        """Returns whether the last finished scene of a synchronous camera has the given stamp [ns].

        A scene is finished when its frame was passed to the sink, or if it has no viewers.
        """
        return self._shown_ns.get(name) == stamp_ns

    @property
    def is_up(self) -> bool:
        """Whether the simulator is connected to a renderer process."""
        return self._channel is not None

    def wait(self, timeout_s: float) -> None:
        """Waits for a message from the process, for at most `timeout_s`."""
        if self._channel is None:
            time.sleep(min(timeout_s, 0.01))
        else:
            self._channel.wait(timeout_s)

    def send(self, sample: SceneSample) -> None:
        """Sends a scene to the renderer, or keeps it until the renderer has accepted the camera's previous scene.

        A newer scene of the same camera replaces a scene that is being kept.
        """
        self._waiting[sample.name] = DrawnScene(sample, dict(self._body_ids()))
        self._send_waiting(sample.name)

    def serve_late(self) -> None:
        """Sends the last scene of each camera that gained viewers while the world is stopped to the renderer again."""
        for name, scene in self._last.items():
            if self._demands.get(name, NO_DEMAND).seen > self._served.get(name, 0):
                self._waiting.setdefault(name, scene)
                self._send_waiting(name)

    def forget_scenes(self) -> None:
        """Drops the scenes that wait to be sent, and the scenes that are kept for viewers that connect later."""
        self._waiting.clear()
        self._last.clear()

    def forget_body(self, name: str) -> None:
        """Deletes a body from the stored scenes, since a later body of the same name may differ."""
        for scenes in (self._waiting, self._last):
            for camera, scene in scenes.items():
                bodies = tuple(body for body in scene.sample.bodies if body.name != name)
                scenes[camera] = scene._replace(sample=scene.sample._replace(bodies=bodies))

    def stop(self) -> bool:
        """Ends the process; kills it if it is still starting, or does not end within STOP_TIMEOUT_S.

        Returns:
            False if the process was killed.
        """
        was_killed = False
        if self._channel is not None:
            self._channel.close()
            self._channel = None
        if self._process is not None:
            try:
                self._process.wait(STOP_TIMEOUT_S if self.renderer else 0.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
                was_killed = True
            self._process = None
        self._start_at_s = float("inf")
        return not was_killed

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [*self._command, "--socket", str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,  # PyBullet and its plugin print a lot
                pass_fds=[theirs.fileno()],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
        self._started_s = self._heard_s = time.monotonic()
        self._channel = Channel(ours)
        self._channel.send(SetUp(tuple(self._cameras.values()), self._use_egl))
        self._send_log()

    def _watch(self, is_heard: bool) -> None:
        """Logs a warning if the process has been silent for SILENT_AFTER_S, and another once messages arrive again.

        Args:
            is_heard: Whether messages have arrived since the last call; also true while the process starts.
        """
        now_s = time.monotonic()
        if is_heard:
            self._heard_s = now_s
            if self.fault:
                self.fault = ""
                log.warning("camera: the renderer answers again")
        elif not self.fault and now_s - self._heard_s > SILENT_AFTER_S:
            assert self._process is not None
            state = "is stopped by a signal" if is_stopped(self._process.pid) else "hangs, or gets no processor time"
            self.fault = f"the renderer (process {self._process.pid}) {state}"
            log.warning("camera: %s: no images for %g s", self.fault, SILENT_AFTER_S)

    def _bury(self) -> None:
        """If the process has ended, logs why, and decides when to restart the process and whether to try EGL again."""
        assert self._process is not None
        code = self._process.poll()
        if code is None:
            return
        now_s = time.monotonic()
        self._failures = 0 if now_s - self._started_s > STABLE_AFTER_S else self._failures + 1
        from_outside = code in (-signal.SIGKILL, -signal.SIGTERM)
        if self._use_egl and not from_outside and (not self.renderer or self._failures > 2):
            self._use_egl = False
        pause_s = min(2.0 ** (self._failures - 2), LONGEST_PAUSE_S) if self._failures > 1 else 0.0
        self._start_at_s = now_s + pause_s
        how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        next_time = f"in {pause_s:g} s" if pause_s else "at once"
        kind = "" if self._use_egl else ", without EGL"
        log.warning("camera: the renderer ended with %s; it is started again %s%s", how, next_time, kind)
        self._process = None
        self.renderer = self.fault = ""

    def _forget(self) -> None:
        """Clears all data about the process, before a new process starts."""
        self.wanted = frozenset()
        self._demands: dict[str, Demand] = {}
        self._unread = LoadLogReader(self._log)
        self._waiting: dict[str, DrawnScene] = {}
        self._under_way: set[str] = set()
        self._served: dict[str, int] = {}
        self._shown_ns: dict[str, int] = {}

    def _send_log(self) -> None:
        if self._channel is not None and (entries := self._unread.drain()):
            self._channel.send(WorldChanged(entries))

    def _send_waiting(self, name: str) -> None:
        if self._channel is None or name in self._under_way or name not in self._waiting:
            return
        self._send_log()
        scene = self._waiting.pop(name)
        self._channel.send(scene)
        self._under_way.add(name)
        self._last[name] = scene
        self._served[name] = self._demands.get(name, NO_DEMAND).seen

    def _on_ready(self, message: Ready) -> None:
        self.renderer = message.renderer
        log.info("camera: images are drawn by %s", message.renderer)

    def _on_scene_accepted(self, message: SceneAccepted) -> None:
        self._under_way.discard(message.camera)
        self._send_waiting(message.camera)

    def _on_shown(self, message: Shown) -> None:
        self._shown_ns[message.camera] = message.stamp_ns

    def _on_demanded(self, message: Demanded) -> None:
        self._demands = {name: demand for name, demand in message.demands.items() if name in self._cameras}
        self.wanted = frozenset(name for name, demand in self._demands.items() if demand.streams)
