"""Sends scenes to the renderer process, which publishes the images."""

import contextlib
import os
import sys
import time
from collections.abc import Callable, Mapping
from functools import partial

import rosgraph
import rospy
from rosnode import cleanup_master_blacklist

from custom_ros_tools.errors import PhysicsError
from custom_ros_tools.sockets import flush_buffered_sockets
from rpbi.engine.priority import run_normally
from rpbi.render.client import RenderClient
from rpbi.render.frame import Camera
from rpbi.ros.headers import named_frame
from rpbi.samples import SceneSample
from rpbi.sensors.rgbd import RgbdSensor
from rpbi.world import World

from .image_publisher import SINK, camera_node, sink_arguments

LONGEST_WAIT_S = 20.0
"""Longest wait of the world for a synchronous camera [s] of wall time; beyond it, the world stops."""


class ScenePublisher:
    """Feeds the renderer process, and reads cameras only while their images have subscribers."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._sensors: Mapping[str, RgbdSensor] = {}
        self._synchronous: tuple[RgbdSensor, ...] = ()
        self._awaited: list[SceneSample] = []
        # a window without a graphics card would leave a renderer of low priority hardly any processor time
        priority = ["--keep-priority"] if world.window else []
        self._renderer = RenderClient(
            (),
            world.log,
            lambda: {name: body.body_id for name, body in world.bodies.items()},
            SINK,
            [*priority, *sink_arguments(rospy.get_name(), sys.argv)],
        )

    def poll(self) -> None:
        """Maintains the process; called at every pass of the loop."""
        if self._sensors is not self._world.cameras:
            self._update_cameras(self._world.cameras)
        self._renderer.poll()
        for name, sensor in self._sensors.items():
            sensor.wanted = name in self._renderer.wanted

    def before_tick(self) -> None:
        """Waits until synchronous cameras are ready for the coming tick.

        Raises:
            PhysicsError: If that takes too long.
        """
        if self._sensors is not self._world.cameras:
            self.poll()
        for sensor in self._synchronous:
            name = sensor.name
            if not self._renderer.knows_demand(name):
                self._wait_for(partial(self._renderer.knows_demand, name), name, "the renderer is not up")
            if sensor.pose is None and sensor.wanted:
                missing = f"there is no TF to '{named_frame(sensor.config.object_tf.tf_id)}'"
                self._wait_for(partial(_is_placed_or_unwanted, sensor), name, missing)

    def publish(self, sample: SceneSample, stamp_ns: int) -> None:
        """Renders and publishes a scene."""
        self._renderer.send(sample)
        if self._sensors[sample.name].config.synchronous:
            self._awaited.append(sample)

    def flush(self) -> None:
        """Waits for the images of synchronous cameras.

        Raises:
            PhysicsError: If one does not come.
        """
        if not self._awaited:
            return
        awaited, self._awaited = self._awaited, []
        for sample in awaited:
            self._wait_for(
                partial(self._renderer.has_shown, sample.name, sample.stamp_ns),
                sample.name,
                f"no image of tick {sample.tick}",
                needs_renderer=True,
            )

    def serve_late(self) -> None:
        """Sends the last images to new subscribers."""
        self._renderer.serve_late()

    def restart(self) -> None:
        """Drops stored scenes after a reset."""
        self._renderer.forget_scenes()

    def forget(self, name: str) -> None:
        """Removes a removed body from scenes that are still to be drawn."""
        self._renderer.forget_body(name)

    def facts(self) -> dict[str, str]:
        """Returns its values for the diagnostics."""
        return {"camera_renderer": self._renderer.renderer or "starting"} if self._sensors else {}

    def fault(self) -> str:
        """Returns why the renderer does not answer, empty if it does."""
        return self._renderer.fault

    def close(self) -> None:
        """Ends the process at normal priority, since it has to unregister from the ROS master first."""
        if self._renderer.process_id is not None:
            nice = os.getpriority(os.PRIO_PROCESS, 0)
            run_normally(self._renderer.process_id, nice)  # otherwise its end might take long on a busy machine
        if not self._renderer.stop():
            _unregister(camera_node(rospy.get_name()))

    def _update_cameras(self, cameras: Mapping[str, RgbdSensor]) -> None:
        for name, sensor in self._sensors.items():
            if cameras.get(name) is not sensor:
                self._renderer.remove(name)
        for name, sensor in cameras.items():
            if self._sensors.get(name) is not sensor:
                camera = Camera.of(sensor.config, sensor.topic_name)
                self._renderer.add(camera._replace(frame_id=named_frame(camera.frame_id)))
        self._sensors = cameras
        self._synchronous = tuple(sensor for sensor in cameras.values() if sensor.config.synchronous)

    def _wait_for(self, condition: Callable[[], bool], name: str, missing: str, needs_renderer: bool = False) -> None:
        """Waits for something of a synchronous camera, or until the node shuts down."""
        end_s = time.monotonic() + LONGEST_WAIT_S
        while not (condition() or rospy.core.is_shutdown_requested()):
            flush_buffered_sockets()  # what it waits for may depend on messages of earlier ticks
            self.poll()
            self._world.apply_inputs()
            if needs_renderer and not self._renderer.is_up:
                raise PhysicsError(f"camera '{name}' is synchronous: {missing}, the renderer has ended")
            if time.monotonic() > end_s:
                raise PhysicsError(f"camera '{name}' is synchronous: {missing} after {LONGEST_WAIT_S:g} s")
            if not condition():
                self._renderer.wait(0.02)


def _unregister(node: str) -> None:
    """Unregisters a killed node from the ROS master."""
    with contextlib.suppress(OSError, rosgraph.MasterException):
        cleanup_master_blacklist(rosgraph.Master(rospy.get_name()), [node])


def _is_placed_or_unwanted(sensor: RgbdSensor) -> bool:
    return sensor.pose is not None or not sensor.wanted
