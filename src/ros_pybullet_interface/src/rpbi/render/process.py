"""The renderer process: receives scenes from the simulator, draws them and passes frames to a sink."""

import faulthandler
import logging
import os
import time
from collections.abc import Callable
from typing import Any

from rpbi.engine.priority import run_normally, yield_to_simulator

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
from .egl import EglError
from .frame import NO_DEMAND, Camera, Demand, Sink
from .mirror import Mirror
from .renderers import Renderer, open_renderer

log = logging.getLogger(__name__)

DEMAND_PERIOD_S = 0.05
"""Period [s] of checks which images have viewers."""

ALIVE_PERIOD_S = 0.5
"""Period [s] of the message `Alive`."""

STUCK_AFTER_S = 300.0
"""Longest pass [s] of the loop; beyond it, a driver probably hangs, and the process ends itself."""


class RenderProcess:
    """Draws scenes for the simulator until the simulator ends.

    Args:
        channel: Connection to the simulator.
        make_sink: Creates the object that receives the frames.
        gives_way: Whether to lower the process's priority after the start; without effect with synchronous cameras.
    """

    def __init__(self, channel: Channel, make_sink: Callable[[], Sink], gives_way: bool) -> None:
        self._channel = channel
        self._make_sink = make_sink
        self._gives_way = gives_way
        self._nice = os.getpriority(os.PRIO_PROCESS, 0)
        self._cameras: dict[str, Camera] = {}
        self._demands: dict[str, Demand] = {}
        self._looked_s = self._alive_s = 0.0
        self._parent = os.getppid()
        self._renderer: Renderer | None = None
        self._mirror: Mirror | None = None
        self._sink: Sink | None = None
        self._do: dict[type, Callable[[Any], None]] = {
            SetUp: self._set_up,
            CameraAdded: lambda message: self._add(message.camera),
            CameraRemoved: lambda message: self._remove(message.name),
            WorldChanged: self._change_world,
            DrawnScene: self._show,
        }

    def run(self) -> None:
        """Handles messages until the simulator closes the connection or ends."""
        try:
            while not self._channel.closed and os.getppid() == self._parent:
                faulthandler.dump_traceback_later(STUCK_AFTER_S, exit=True)
                messages = self._channel.receive()
                if self._gives_way and self._sink is not None and not self._channel.closed:
                    yield_to_simulator()  # only after the start, which would take long at low priority
                    self._gives_way = False
                for message in messages:
                    self._do[type(message)](message)
                self._send_demands()
                self._send_alive()
                self._channel.flush()
                self._channel.wait(DEMAND_PERIOD_S)
        finally:
            if self._sink is not None:
                self._sink.close()
            if self._mirror is not None:
                self._mirror.close()

    def _set_up(self, message: SetUp) -> None:
        self._renderer = open_renderer(message.cameras, message.use_egl)
        self._mirror = Mirror(self._renderer.pb)
        self._channel.send(Ready(self._renderer.name))
        self._sink = self._make_sink()
        for camera in message.cameras:
            self._add(camera)

    def _add(self, camera: Camera) -> None:
        assert self._renderer is not None and self._sink is not None
        if camera.synchronous:  # the simulation waits for its images, so the process keeps its priority
            self._gives_way = False
            run_normally(os.getpid(), self._nice)
        try:
            self._renderer.make_room(camera.intrinsics)
        except EglError as error:
            log.warning("images of '%s' are cut off: %s", camera.name, error)
        self._cameras[camera.name] = camera
        self._sink.add(camera)

    def _remove(self, name: str) -> None:
        assert self._sink is not None
        del self._cameras[name]
        self._sink.remove(name)

    def _change_world(self, message: WorldChanged) -> None:
        assert self._mirror is not None
        for entry in message.entries:
            self._mirror.apply(entry)

    def _show(self, scene: DrawnScene) -> None:
        """Draws those streams of a scene that have viewers, and passes the frame to the sink."""
        sample = scene.sample
        self._channel.send(SceneAccepted(sample.name))
        assert self._sink is not None
        camera = self._cameras.get(sample.name)
        streams = self._sink.demands().get(sample.name, NO_DEMAND).streams
        if camera is None:
            return
        if streams:
            assert self._renderer is not None and self._mirror is not None
            self._sink.write(self._mirror.frame(self._renderer, scene, camera, streams))
        if camera.synchronous:
            self._channel.send(Shown(sample.name, sample.stamp_ns))

    def _send_alive(self) -> None:
        now_s = time.monotonic()
        if self._sink is not None and now_s - self._alive_s >= ALIVE_PERIOD_S:
            self._alive_s = now_s
            self._channel.send(Alive())

    def _send_demands(self) -> None:
        now_s = time.monotonic()
        if self._sink is None or now_s - self._looked_s < DEMAND_PERIOD_S:
            return
        self._looked_s = now_s
        demands = dict(self._sink.demands())
        if demands != self._demands:
            self._demands = demands
            self._channel.send(Demanded(demands))


class ReportHandler(logging.Handler):
    """Sends the log messages of the renderer process to the simulator's log."""

    def __init__(self, channel: Channel) -> None:
        super().__init__(logging.INFO)
        self._channel = channel

    def emit(self, record: logging.LogRecord) -> None:
        """Sends a log message."""
        self._channel.send(Report(record.levelno, self.format(record)))
