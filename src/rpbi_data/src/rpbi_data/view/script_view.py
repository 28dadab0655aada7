"""Shows a world in browsers while a script or a notebook steps it; `World.view` uses this module."""

from __future__ import annotations

import html
import math
import queue
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

import numpy as np

from custom_ros_tools.errors import InterfaceError
from robot_model.geometry import Pose, Vector
from rpbi.bodies.robots.jointed import JointedBody
from rpbi.bodies.robots.robot import Robot
from rpbi.bodies.visual_shapes import body_shapes, link_pose
from rpbi.config.world import WORLD_FRAME
from rpbi.images import CameraImages
from rpbi.render.frame import Camera
from rpbi.sensors.contacts.arrows import ContactArrowsSensor
from rpbi.sensors.surface import SurfaceSensor
from rpbi.world import World

from .controls import JointRange, NewObject
from .live_view import FRAMES_HZ, REFRESH_HZ, LiveView
from .moment import CameraItem, Item, LinesItem, Moment, Name, Placed, ShapeItem, SurfaceItem, is_finite
from .panel import COMMANDS
from .scene import Array
from .web_server import WebServer

SURFACES_HZ, IMAGES_HZ = 10.0, 5.0
"""Rates of surfaces of soft bodies, and of images, in wall time [Hz]."""
LIMIT_S = 5.0
"""Time after which a request counts as unanswered [s]; requests are answered while the script steps the world."""
PAUSE_S = 0.005
ARROW_M, ARROW_RGBA = 0.012, (0.84, 0.15, 0.16, 1.0)
CAMERA, CONTACTS, SURFACE = "camera", "contacts", "surface"


class WorldView:
    """Shows a world in browsers. A notebook shows the page if this object is the last line of a cell.

    The view is drawn and its buttons are served when the world is stepped. `Stop` makes the next `World.step` wait
    until `Start` is pressed. Only the thread of the world may create and close this object.

    Args:
        world: The world.
        host: Address to listen at.
        port: Port of the page; 0 chooses a free port.

    Raises:
        InterfaceError: If the port is in use, or the extra `html` is missing.
    """

    def __init__(self, world: World, host: str, port: int) -> None:
        server = WebServer(host, port)
        self._source = _WorldSource(world)
        self._controls = _WorldControls(world)
        self._view = LiveView(self._source, self._controls, server)
        self._is_closed = False
        self.update()

    @property
    def link(self) -> str:
        """Address of the page."""
        return self._view.link

    def update(self) -> None:
        """Serves requests of viewers, and shows the world as it is now; every `World.step` calls this method."""
        if self._is_closed:
            return
        self._source.update()
        self._controls.serve()
        while self._controls.is_paused and not self._is_closed:
            time.sleep(PAUSE_S)
            self._source.update()
            self._controls.serve()

    def close(self) -> None:
        """Ends the view and its web server."""
        self._is_closed = True
        self._view.close()
        self._source.close()

    def __enter__(self) -> WorldView:
        """Returns itself; the end of the `with` block calls `close`."""
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        return f'<iframe src="{html.escape(self.link)}" width="100%" height="500" style="border: 0"></iframe>'


class _Due:
    """Tells whether a period of wall time has passed."""

    def __init__(self, hz: float) -> None:
        self._period_s, self._due_s = 1.0 / hz, -math.inf

    def __call__(self) -> bool:
        now_s = time.monotonic()
        if now_s < self._due_s:
            return False
        self._due_s = now_s + self._period_s
        return True


class _WorldSource:
    """Reads frames and items from a world. Only `update` and `close` must be called in the thread of the world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._seen: tuple[object, ...] = ()
        self._shapes: dict[Name, Item] = {}
        self._surfaces: dict[Name, Item] = {}
        self._is_frame_due, self._is_surface_due, self._is_image_due = map(_Due, (FRAMES_HZ, SURFACES_HZ, IMAGES_HZ))
        self._moment = Moment(time.monotonic(), 0.0, WORLD_FRAME, {}, {})
        self._renderer: CameraImages | None = None
        self._wanted = ""
        self._picture: tuple[float, Array | None, Name | None] = (0.0, None, None)
        self.images: Sequence[str] = ()
        self.camera = world.config.resetDebugVisualizerCamera

    def moment(self) -> Moment:
        """Returns the content at the last update."""
        return replace(self._moment, wall_s=time.monotonic())

    def choose_image(self, name: str) -> None:
        """Chooses a camera."""
        self._wanted = name

    def picture(self) -> tuple[float, Array | None, Name | None]:
        """Returns the last image of the chosen camera."""
        return self._picture

    def update(self) -> None:
        """Reads the world, if a frame is due."""
        if not self._is_frame_due():
            return
        world = self._world
        present = (len(world.log), *world.bodies.values())
        if present != self._seen:
            self._seen = present
            self._shapes = {**dict(self._all_shapes()), **dict(self._all_cameras())}
            self._surfaces = {}
        if self._is_surface_due():
            self._surfaces = dict(self._all_surfaces())
        frames = dict(self._frames())
        items = {**self._shapes, **self._surfaces, **dict(self._arrows())}
        self._moment = Moment(time.monotonic(), world.clock.time_s, WORLD_FRAME, frames, items)
        self.images = tuple(world.cameras)
        if self._wanted in world.cameras and self._is_image_due():
            self._draw(self._wanted)

    def close(self) -> None:
        """Ends the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _all_shapes(self) -> Any:
        for body in self._world.bodies.values():
            for number, shape in enumerate(body_shapes(body)):
                frame = f"{body.name}/{shape.link}"
                yield (body.name, str(number)), ShapeItem(frame, shape.pose_in_link, shape)

    def _all_surfaces(self) -> Any:
        for body in self._world.bodies.values():
            if body.is_soft:
                sample = SurfaceSensor(body, SURFACES_HZ).read(self._world.clock.tick)
                corners = np.array(sample.corners, np.float32)
                yield (body.name, SURFACE), SurfaceItem(WORLD_FRAME, Pose(), corners, sample.rgba)

    def _frames(self) -> Any:
        links = {
            item.frame: (name[0], item.shape.link_index)
            for name, item in self._shapes.items()
            if isinstance(item, ShapeItem)
        }
        for frame, (body, index) in links.items():
            pose = Pose(*link_pose(self._world.bodies[body], index))
            if is_finite(pose):
                yield frame, Placed(WORLD_FRAME, pose)
        for name, camera in self._world.cameras.items():
            if camera.pose is not None:
                yield f"{CAMERA}/{name}", Placed(WORLD_FRAME, Pose(*camera.pose))

    def _arrows(self) -> Any:
        for name in self._world.bodies:
            for sensor in self._world.sensors_of(name):
                if isinstance(sensor, ContactArrowsSensor):
                    arrows = sensor.read(self._world.clock.tick).arrows
                    points = np.array(arrows, np.float32).reshape(-1, 2, 3)
                    yield (name, CONTACTS), LinesItem(WORLD_FRAME, Pose(), points, ARROW_RGBA, ARROW_M, True)

    def _all_cameras(self) -> Any:
        for name, camera in self._world.cameras.items():
            intrinsics = Camera.of(camera.config).intrinsics
            fov_rad = 2.0 * math.atan(intrinsics.height_px / 2.0 / intrinsics.K[1][1])
            aspect = intrinsics.width_px / intrinsics.height_px
            yield (CAMERA, name), CameraItem(f"{CAMERA}/{name}", Pose(), fov_rad, aspect)

    def _draw(self, camera: str) -> None:
        self._renderer = self._renderer or CameraImages(self._world)
        try:
            pixels = self._renderer.frame(camera).colour
        except ValueError:  # its pose is unknown
            pixels = None
        self._picture = time.monotonic(), pixels, (CAMERA, camera)


class _WorldControls:
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
        self._is_refresh_due = _Due(REFRESH_HZ)

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
