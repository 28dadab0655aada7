"""Converts a scene to one HTML page with viser."""

from __future__ import annotations

import contextlib
import html
import io
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from custom_ros_tools.errors import MissingDependency
from rpbi.bodies.visual_shapes import BodyShape

from .first_view import FOV_RAD
from .page_parts import BODY, HEAD
from .scene import Array, Arrows, PageScene, ShownLink, TriangleMesh
from .shapes import add_shape

try:
    import viser
except ImportError as error:
    raise MissingDependency(error.name or "viser", "./rpbi setup html") from None

MAX_BYTES = 2_000_000
"""Size above which a page is made again with fewer times [bytes]."""
MIN_TIMES = 10
"""Smallest number of times to which a page is reduced."""
STILL = 1e-5
"""Change of a position component [m] or a quaternion component above which it is shown."""
POSE_STEP, ARROW_STEP = 2.0**-15, 2.0**-12
"""Steps to which poses [m, or without unit in quaternions] and arrows [m] are rounded, so that pages are smaller."""
LONG_ARROW_M, MAX_ARROW_M = 0.4, 0.8
"""Approximate 95th percentile of arrow lengths, and length to which longer arrows are shortened [m]."""
CONTACT_RGB, SENSOR_RGB = (214, 39, 40), (31, 119, 180)
SHAFT_M, HEAD_M, HEAD_LENGTH_M = 0.006, 0.014, 0.035
"""Radii of shaft and head of an arrow, and length of its head [m]."""
MAX_LINE_POINTS, MAX_POINTS = 1500, 30_000
"""Maximum number of points of a line, and of all lines together; longer lines are reduced to extremes of intervals."""
_WXYZ = [3, 0, 1, 2]


def page_of(scene: PageScene) -> tuple[str, PageScene]:
    """Returns the HTML text of a page, and the shown scene, which has fewer times if the page would be too large."""
    while len((text := _page(scene)).encode()) > MAX_BYTES and len(scene.times) > MIN_TIMES:
        scene = scene.coarser(max(MIN_TIMES, len(scene.times) // 2))
    return text, scene


def _page(scene: PageScene) -> str:
    metres_per_newton = _arrow_scale(scene.arrows)
    with contextlib.redirect_stdout(io.StringIO()):  # viser prints its address
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        try:
            recording = server.get_scene_serializer()
            _record(server, recording, scene, metres_per_newton)
            text: str = recording.as_html()
        finally:
            server.stop()
    return _with_plots(text, scene, metres_per_newton)


def _record(server: Any, recording: Any, scene: PageScene, metres_per_newton: float) -> None:
    server.scene.set_up_direction("+z")
    server.initial_camera.position, server.initial_camera.look_at = scene.camera
    server.initial_camera.fov = FOV_RAD
    players: list[_LinkPlayer | _ArrowPlayer] = [_LinkPlayer(server.scene, link, scene.meshes) for link in scene.links]
    players += [_ArrowPlayer(server.scene, arrows, metres_per_newton) for arrows in scene.arrows]
    for number, time_s in enumerate(scene.times):
        recording.insert_sleep(float(time_s - scene.times[max(number - 1, 0)]))
        for player in players:
            player.show(number)


class _LinkPlayer:
    """Moves a link in viser to its pose at a given time of the scene."""

    def __init__(self, api: Any, link: ShownLink, meshes: Mapping[BodyShape, TriangleMesh]) -> None:
        name = f"/{link.body}/{link.name}"
        self._position = _rounded(link.poses.position, POSE_STEP)
        self._wxyz = _rounded(link.poses.rotation.as_quat()[:, _WXYZ], POSE_STEP)
        self._is_there = link.is_there
        self._frame = api.add_frame(
            name, show_axes=False, position=self._position[0], wxyz=self._wxyz[0], visible=bool(link.is_there[0])
        )
        for number, shape in enumerate(link.shapes):
            add_shape(api, f"{name}/{number}", shape, meshes)

    def show(self, number: int) -> None:
        self._frame.visible = bool(self._is_there[number])
        if np.abs(self._position[number] - self._frame.position).max() > STILL:
            self._frame.position = self._position[number]
        if np.abs(self._wxyz[number] - self._frame.wxyz).max() > STILL:
            self._frame.wxyz = self._wxyz[number]


class _ArrowPlayer:
    """Draws the forces of a topic in viser at a given time of the scene."""

    def __init__(self, api: Any, arrows: Arrows, metres_per_newton: float) -> None:
        self._segments = [
            _rounded(_segments(points, forces * metres_per_newton), ARROW_STEP).astype(np.float32)
            for points, forces in zip(arrows.points, arrows.forces, strict=True)
        ]
        self._handle = api.add_arrows(
            f"/forces/{arrows.topic.strip('/').replace('/', '.')}",
            self._segments[0] if len(self._segments[0]) else np.zeros((1, 2, 3), np.float32),
            CONTACT_RGB if arrows.is_contact else SENSOR_RGB,
            shaft_radius=SHAFT_M,
            head_radius=HEAD_M,
            head_length=HEAD_LENGTH_M,
            visible=bool(len(self._segments[0])),
        )

    def show(self, number: int) -> None:
        segments = self._segments[number]
        self._handle.visible = bool(len(segments))
        if len(segments) and not np.array_equal(segments, self._handle.points):
            self._handle.points = segments


def _segments(points: Array, arrows: Array) -> Array:
    """Returns start and end of each arrow, shape (k, 2, 3) [m].

    Arrows longer than `MAX_ARROW_M` are shortened. Arrows that are not longer than their head are left out.
    """
    length = np.linalg.norm(arrows, axis=1, keepdims=True)
    cut = arrows * np.minimum(1.0, MAX_ARROW_M / np.maximum(length, 1e-9))
    return np.stack([points, points + cut], axis=1)[length[:, 0] > HEAD_M]


def _arrow_scale(arrows: list[Arrows]) -> float:
    """Returns the arrow length per force, rounded to 1, 2 or 5 times a power of ten [m/N]."""
    forces = np.concatenate([np.empty((0, 3)), *(each for of_topic in arrows for each in of_topic.forces)])
    sizes = np.linalg.norm(forces, axis=1)
    sizes = sizes[sizes > 0.0]
    if not len(sizes):
        return 0.01
    exponent = np.log10(LONG_ARROW_M / float(np.percentile(sizes, 95.0)))
    power = np.floor(exponent)
    return float(min((step * 10.0**power for step in (1, 2, 5, 10)), key=lambda each: abs(np.log10(each) - exponent)))


def _rounded(values: Array, step: float) -> Array:
    return np.asarray(np.round(values / step) * step)


def _with_plots(text: str, scene: PageScene, metres_per_newton: float) -> str:
    """Adds plots below the 3-D view to viser's page, and returns the HTML text."""
    count = min(MAX_LINE_POINTS, MAX_POINTS // max(1, sum(map(len, scene.panels.values()))))
    data = {
        "title": scene.title,
        "seconds": round(float(scene.times[-1]), 6),
        "legend": f"arrows: 0.1 m is {0.1 / metres_per_newton:g} N" if scene.arrows else "no forces were recorded",
        "notes": scene.all_notes,
        "panels": [
            {"title": title, "lines": [{"name": name, **_points(line, count)} for name, line in lines.items()]}
            for title, lines in scene.panels.items()
        ],
    }
    content = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")  # a text may contain </script>
    text = text.replace("<title>Viser</title>", f"<title>{html.escape(scene.title)}</title>", 1)
    text = text.replace("</head>", f"{HEAD}</head>", 1)
    end = text.rindex("</body>")
    return f"{text[:end]}<script>const EPISODE={content};</script>{BODY}{text[end:]}"


def _points(line: pd.Series, count: int) -> dict[str, list[float]]:
    """Returns the points of a line as lists `x` and `y`.

    A line with more than `count` points is divided into `count // 2` intervals. From each interval, only the smallest
    and the largest value are kept.
    """
    values = line.dropna()
    x, y = values.index.to_numpy(float), values.to_numpy(float)
    if len(y) > count:
        starts = np.linspace(0, len(y), count // 2 + 1).astype(int)
        chosen = [
            begin + each
            for begin, end in zip(starts[:-1], starts[1:], strict=True)
            for each in sorted({int(y[begin:end].argmin()), int(y[begin:end].argmax())})
        ]
        x, y = x[chosen], y[chosen]
    return {"x": [round(each, 3) for each in x.tolist()], "y": [float(f"{each:.4g}") for each in y.tolist()]}
