"""Messages between simulator and renderer process."""

from collections.abc import Mapping
from typing import NamedTuple

from rpbi.samples import SceneSample
from rpbi.world.load_log import LogEntry

from .frame import Camera, Demand


class SetUp(NamedTuple):
    """To the renderer, first of all: the cameras, and whether to try the fast renderer."""

    cameras: tuple[Camera, ...]
    use_egl: bool


class CameraAdded(NamedTuple):
    """To the renderer: there is another camera."""

    camera: Camera


class CameraRemoved(NamedTuple):
    """To the renderer: a camera has gone."""

    name: str


class WorldChanged(NamedTuple):
    """To the renderer: changes of the world since the last message."""

    entries: tuple[LogEntry, ...]


class DrawnScene(NamedTuple):
    """To the renderer: a tick to draw.

    Attributes:
        sample: Where everything is.
        body_ids: PyBullet's ids in the simulator by name, for the segmentation.
    """

    sample: SceneSample
    body_ids: Mapping[str, int]


class Ready(NamedTuple):
    """To the simulator: name of the renderer, `EGL` or `TinyRenderer`, with details."""

    renderer: str


class Alive(NamedTuple):
    """To the simulator: the renderer works; twice a second, unless a frame takes longer."""


class SceneAccepted(NamedTuple):
    """To the simulator: the scene of this camera is being drawn, the next one may come."""

    camera: str


class Shown(NamedTuple):
    """To the simulator: the frame of a synchronous camera of that stamp [ns] was handed on, or nobody looks at it."""

    camera: str
    stamp_ns: int


class Demanded(NamedTuple):
    """To the simulator: demands by camera."""

    demands: Mapping[str, Demand]


class Report(NamedTuple):
    """To the simulator: something for its log, at a level of `logging`."""

    level: int
    text: str
