"""The view of a running world in browsers: draws the world at a fixed rate, and keeps its last seconds."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from rpbi.config.pybullet_world_models import ResetDebugVisualizerCamera

from .controls import Controls
from .first_view import FOV_RAD, first_view
from .live_scene import LiveScene
from .moment import History, Moment, Name, ShapeItem, moment_at
from .panel import ViewPanel
from .scene import Array, Poses, ShownLink
from .web_server import WebServer

FRAMES_HZ, REFRESH_HZ, IMAGES_HZ = 30.0, 4.0, 10.0
"""Rates of poses, of the fields of the panel, and of images, in wall time [Hz]."""
IDLE_HZ = 2.0
"""Rate at which the scene is drawn while nobody looks, so that the next viewer sees it at once [Hz]."""
LAST_CALL_S = 2.0
"""Longest time to wait for the last call of a thread at the end [s]."""
CAMERA_S = 1.0
"""Longest time to wait for the configuration of the world after the first shapes [s]."""

_log = logging.getLogger(__name__)


class ViewSource(Protocol):
    """Content of a live view."""

    def moment(self) -> Moment:
        """Returns frames and items as they are now. A returned moment must never change."""

    @property
    def camera(self) -> ResetDebugVisualizerCamera | None:
        """Camera of PyBullet's window in the configuration of the world; None if it is not known yet."""

    @property
    def images(self) -> Sequence[str]:
        """Names of the images that can be chosen."""

    def choose_image(self, name: str) -> None:
        """Chooses one of `images`; an empty text chooses none."""

    def picture(self) -> tuple[float, Array | None, Name | None]:
        """Returns time [s] and pixels of the newest chosen image, and the name of its camera's item."""


class _Loop:
    """Calls a function at a fixed rate of wall time in a thread. An error is reported, and the thread continues."""

    def __init__(self, name: str, hz: float, call: Callable[[], None]) -> None:
        self._period_s, self._call, self._fault = 1.0 / hz, call, ""
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Ends the thread, and waits for its last call, but not without limit."""
        self._ended.set()
        if threading.current_thread() is not self._thread:
            self._thread.join(LAST_CALL_S)

    def _run(self) -> None:
        next_s = time.monotonic()
        while not self._ended.wait(max(0.0, next_s - time.monotonic())):
            next_s = max(next_s + self._period_s, time.monotonic() - self._period_s)  # keeps the mean rate
            try:
                self._call()
            except Exception as error:
                if str(error) != self._fault and not self._ended.is_set():  # each is reported once
                    self._fault = str(error)
                    _log.exception("%s: a part of the view is missing", self._thread.name)


class LiveView:
    """Shows a world in browsers, until it is closed.

    One thread draws the present moment, or a moment of the past if a viewer has moved the time line. It waits for
    nothing: viser sends in another thread, and drops the changes that a slow viewer has missed. Two other threads keep
    the panel up to date and show images; they may have to wait for the world.

    Args:
        source: Content of the view.
        controls: Controls of the world.
        server: The web server, which `close` ends.
    """

    def __init__(self, source: ViewSource, controls: Controls, server: WebServer) -> None:
        self._source, self._server = source, server
        server.viser.scene.set_up_direction("+z")
        server.viser.initial_camera.fov = FOV_RAD
        self._scene = LiveScene(server.viser)
        self._panel = ViewPanel(server.viser.gui, controls)
        self._history = History()
        self._past: tuple[Moment, ...] = ()
        self._first_s = math.inf
        self._idle_due_s = 0.0
        self._shown_image: tuple[str, float] = ("", 0.0)
        self.is_drawn = threading.Event()
        """Set when the first shapes have been drawn."""
        self._loops = (
            _Loop("scene", FRAMES_HZ, self._draw),
            _Loop("panel", REFRESH_HZ, self._refresh),
            _Loop("images", IMAGES_HZ, self._show_image),
        )

    @property
    def link(self) -> str:
        """Address of the page."""
        return self._server.link

    @property
    def viewers(self) -> int:
        """Number of connected viewers."""
        return len(self._server.viser.get_clients())

    def close(self) -> None:
        """Ends the view, its threads and its web server."""
        for loop in self._loops:
            loop.end()
        self._source.choose_image("")
        self._server.close()

    def _draw(self) -> None:
        moment = self._source.moment()
        self._history.add(moment)
        if not self.viewers and moment.wall_s < self._idle_due_s:
            return
        self._idle_due_s = moment.wall_s + 1.0 / IDLE_HZ
        self._panel.advance(1.0 / FRAMES_HZ)
        self._scene.shows_frames, self._scene.shows_names = self._panel.shows_frames, self._panel.shows_names
        self._scene.show(self._chosen(moment))
        if not self.is_drawn.is_set() and any(isinstance(each, ShapeItem) for each in moment.items.values()):
            self._first_s = min(self._first_s, moment.wall_s)
            if self._source.camera is not None or moment.wall_s - self._first_s > CAMERA_S:
                self._look_at(moment)

    def _refresh(self) -> None:
        self._panel.refresh(self._source.images)
        self._source.choose_image(self._panel.image if self.viewers else "")

    def _chosen(self, moment: Moment) -> Moment:
        """Returns the moment at the chosen point of the time line."""
        age_s = self._panel.age_s
        if not age_s:
            self._past = ()
            return moment
        self._past = self._past or self._history.copy()
        return moment_at(self._past, age_s)

    def _show_image(self) -> None:
        if not self.viewers:
            return
        chosen = self._panel.image
        if not chosen:
            if self._shown_image[0]:
                self._panel.show_image(None)
            self._shown_image = "", 0.0
            return
        arrival_s, pixels, camera = self._source.picture()
        if pixels is None or self._shown_image == (chosen, arrival_s):
            return
        self._shown_image = chosen, arrival_s
        self._panel.show_image(pixels)
        if camera is not None and (frustum := self._scene.camera(camera)) is not None:
            frustum.image = pixels

    def _look_at(self, moment: Moment) -> None:
        """Sets the camera of pages that are opened later, so that it sees all shapes."""
        poses, there = moment.poses(), np.ones(1, bool)
        links = []
        for item in moment.items.values():
            if isinstance(item, ShapeItem) and item.frame in poses:
                pose = poses[item.frame]
                where = Poses(np.array([pose.position]), Rotation.from_quat([pose.quat_xyzw]))
                links.append(ShownLink(item.frame, item.frame, [item.shape], where, there))
        camera: Any = self._server.viser.initial_camera
        camera.position, camera.look_at = first_view(
            self._source.camera or ResetDebugVisualizerCamera(), links, self._scene.meshes
        )
        self.is_drawn.set()
