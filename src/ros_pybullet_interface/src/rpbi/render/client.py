"""The simulator's side of the renderer process."""

from __future__ import annotations

import logging
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..load_log import LogEntry
from ..samples import SceneSample
from .channel import Channel
from .frame import NO_DEMAND, Camera, Demand
from .messages import Demanded, Ready, Report, Scene, SetUp, Taken, WorldChanged

log = logging.getLogger(__name__)

LONGEST_PAUSE_S = 30.0
STABLE_AFTER_S = 10.0
STOP_TIMEOUT_S = 5.0


class RenderClient:
    """Keeps a renderer process alive and fed, without ever waiting for it.

    All methods are for the simulation thread. At most one scene per camera is under way; as long as the
    renderer has not taken it, newer ones replace each other here.

    Args:
        cameras: All cameras, the first one first.
        load_log: The world's load log, which may grow at any time; the process gets all of it.
        body_ids: Returns PyBullet's body ids by name.
        sink: `module:factory` of what takes the frames in the other process (see `frame.Sink`).
        arguments: Further arguments of the process, for the sink.
        use_egl: Whether to try the fast renderer at all.
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
        """Names of the cameras that somebody looks at."""
        self.renderer = ""
        """What draws, once it does."""
        self._cameras = tuple(cameras)
        self._log = load_log
        self._body_ids = body_ids
        self._command = ("-P", "-m", "rpbi.render", "--sink", sink, *arguments)
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: Channel | None = None
        self._use_egl = use_egl
        self._started_s = 0.0
        self._start_at_s = 0.0
        self._failures = 0
        self._last: dict[str, Scene] = {}
        self._forget()
        self._do: dict[type, Callable[[Any], None]] = {
            Ready: self._take_ready,
            Taken: self._take_taken,
            Demanded: self._take_demands,
            Report: lambda report: log.log(report.level, "camera: %s", report.text),
        }

    @property
    def process_id(self) -> int | None:
        """The renderer's process id, None while there is none."""
        return None if self._process is None else self._process.pid

    def poll(self) -> None:
        """Starts the process, hears it, starts it again; call it at every pass of the loop."""
        if self._channel is None:
            if self._process is not None:
                self._bury()
            elif time.monotonic() >= self._start_at_s:
                self._start()
            return
        self._channel.flush()
        for message in self._channel.receive():
            self._do[type(message)](message)
        if self._channel.closed:
            self._channel.close()
            self._channel = None
            self._forget()

    def send(self, sample: SceneSample) -> None:
        """Has a scene drawn, or a newer one in its place if the renderer is not ready for it in time."""
        self._waiting[sample.name] = Scene(sample, dict(self._body_ids()))
        self._send_waiting(sample.name)

    def serve_late(self) -> None:
        """Has the last scenes drawn again for viewers that have come since; for a world that stands still."""
        for name, scene in self._last.items():
            if self._demands.get(name, NO_DEMAND).seen > self._served.get(name, 0):
                self._waiting.setdefault(name, scene)
                self._send_waiting(name)

    def stop(self) -> None:
        """Ends the process, and waits for that for a moment."""
        if self._channel is not None:
            self._channel.close()
            self._channel = None
        if self._process is not None:
            try:
                self._process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process = None
        self._start_at_s = float("inf")

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, *self._command, "--socket", str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,  # PyBullet and its plugin are talkative
                pass_fds=[theirs.fileno()],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            )
        self._started_s = time.monotonic()
        self._channel = Channel(ours)
        self._channel.send(SetUp(self._cameras, self._use_egl))
        self._send_log()

    def _bury(self) -> None:
        """Reports the end of the process and decides when to start the next, and which kind."""
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
        self.renderer = ""

    def _forget(self) -> None:
        """Forgets what the process knew."""
        self.wanted = frozenset()
        self._demands: Mapping[str, Demand] = {}
        self._logged = 0
        self._waiting: dict[str, Scene] = {}
        self._under_way: set[str] = set()
        self._served: dict[str, int] = {}

    def _send_log(self) -> None:
        if len(self._log) != self._logged and self._channel is not None:
            self._channel.send(WorldChanged(tuple(self._log[self._logged :])))
            self._logged = len(self._log)

    def _send_waiting(self, name: str) -> None:
        if self._channel is None or name in self._under_way or name not in self._waiting:
            return
        self._send_log()
        scene = self._waiting.pop(name)
        self._channel.send(scene)
        self._under_way.add(name)
        self._last[name] = scene
        self._served[name] = self._demands.get(name, NO_DEMAND).seen

    def _take_ready(self, message: Ready) -> None:
        self.renderer = message.renderer
        log.info("camera: images are drawn by %s", message.renderer)

    def _take_taken(self, message: Taken) -> None:
        self._under_way.discard(message.camera)
        self._send_waiting(message.camera)

    def _take_demands(self, message: Demanded) -> None:
        self._demands = message.demands
        self.wanted = frozenset(name for name, demand in message.demands.items() if demand.streams)
