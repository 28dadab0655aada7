"""Sends scenes to the renderer process, which draws and publishes the camera images."""

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
"""Longest wall time [s] that the world waits for a synchronous camera; beyond it, the world stops."""


class ScenePublisher:
    """Runs the renderer process and sends scenes to it, only for cameras whose images have subscribers."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._sensors: Mapping[str, RgbdSensor] = {}
        self._synchronous: tuple[RgbdSensor, ...] = ()
        self._awaited: list[SceneSample] = []
        # without a graphics card, drawing a window would leave a low-priority renderer hardly any processor time
        priority = ["--keep-priority"] if world.window else []
        self._renderer = RenderClient(
            (),
            world.log,
            lambda: {name: body.body_id for name, body in world.bodies.items()},
            SINK,
            [*priority, *sink_arguments(rospy.get_name(), sys.argv)],
        )

    def poll(self) -> None:
        """Updates the list of cameras from the world, and exchanges messages with the renderer process.

        Call this method in every pass of the simulation loop.
        """
        if self._sensors is not self._world.cameras:
            self._update_cameras(self._world.cameras)
        self._renderer.poll()
        for name, sensor in self._sensors.items():
            sensor.wanted = name in self._renderer.wanted

    def before_tick(self) -> None:
        """Waits until all synchronous cameras are ready for the next tick.

        A camera is ready if the renderer has reported whether the camera's topics have subscribers. If they have
        subscribers, the camera's pose must also be known.

        Raises:
            PhysicsError: If a camera is not ready after LONGEST_WAIT_S.
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
        """Sends a scene to the renderer process, which draws and publishes the scene's images."""
        self._renderer.send(sample)
        if self._sensors[sample.name].config.synchronous:
            self._awaited.append(sample)

    def flush(self) -> None:
        """Waits until the renderer process has published the images of all synchronous cameras' scenes.

        Raises:
            PhysicsError: If an image is not published in time, or the renderer has ended.
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
        """Makes the renderer process send the last images to subscribers that have connected since these images."""
        self._renderer.serve_late()

    def restart(self) -> None:
        """Drops all scenes that wait to be drawn or are kept for later subscribers. Called after a reset."""
        self._renderer.forget_scenes()

    def forget(self, name: str) -> None:
        """Deletes a removed body from the stored scenes."""
        self._renderer.forget_body(name)

    def facts(self) -> dict[str, str]:
        """Returns the renderer's name as an entry for the diagnostics; an empty mapping without cameras."""
        return {"camera_renderer": self._renderer.renderer or "starting"} if self._sensors else {}

    def fault(self) -> str:
        """Returns why the renderer process does not answer; an empty text if the process answers."""
        return self._renderer.fault

    def close(self) -> None:
        """Ends the renderer process.

        The process first gets normal priority, since it has to unregister from the ROS master before it ends.
        """
        if self._renderer.process_id is not None:
            nice = os.getpriority(os.PRIO_PROCESS, 0)
            run_normally(self._renderer.process_id, nice)  # otherwise ending might take long on a busy machine
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
        """Waits until a condition for a synchronous camera holds, or the node shuts down.

        Args:
            condition: Returns whether the condition holds.
            name: Name of the camera.
            missing: Text that says what is missing, for the error message.
            needs_renderer: Whether to fail at once if the renderer process has ended.

        Raises:
            PhysicsError: If the condition does not hold after LONGEST_WAIT_S.
        """
        end_s = time.monotonic() + LONGEST_WAIT_S
        while not (condition() or rospy.core.is_shutdown_requested()):
            flush_buffered_sockets()  # the condition may depend on messages of earlier ticks
            self.poll()
            self._world.apply_inputs()
            if needs_renderer and not self._renderer.is_up:
                raise PhysicsError(f"camera '{name}' is synchronous: {missing}, the renderer has ended")
            if time.monotonic() > end_s:
                raise PhysicsError(f"camera '{name}' is synchronous: {missing} after {LONGEST_WAIT_S:g} s")
            if not condition():
                self._renderer.wait(0.02)


def _unregister(node: str) -> None:
    """Unregisters a node from the ROS master, after the node was killed."""
    with contextlib.suppress(OSError, rosgraph.MasterException):
        cleanup_master_blacklist(rosgraph.Master(rospy.get_name()), [node])


def _is_placed_or_unwanted(sensor: RgbdSensor) -> bool:
    return sensor.pose is not None or not sensor.wanted
