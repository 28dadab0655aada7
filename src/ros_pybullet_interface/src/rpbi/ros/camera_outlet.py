"""Where scenes go: to the renderer process, which publishes the images."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Mapping

import rospy

from ..camera import Intrinsics
from ..render.client import RenderClient
from ..render.frame import Camera
from ..samples import SceneSample
from ..sensors import RgbdSensor
from ..world import World
from .image_sink import SINK, sink_arguments


class CameraOutlet:
    """Feeds the renderer process, and has cameras read only while somebody looks at their images.

    Args:
        world: The world that the cameras are in.
    """

    def __init__(self, world: World) -> None:
        self._sensors: Mapping[str, RgbdSensor] = world.cameras
        self._renderer = RenderClient(
            [_camera(sensor) for sensor in world.cameras.values()],
            world.log,
            lambda: {name: body.body_id for name, body in world.bodies.items()},
            SINK,
            sink_arguments(rospy.get_name(), sys.argv),
        )

    def poll(self) -> None:
        """Sees to the process; called at every pass of the loop."""
        self._renderer.poll()
        for name, sensor in self._sensors.items():
            sensor.wanted = name in self._renderer.wanted

    def publish(self, sample: SceneSample, stamp_ns: int) -> None:
        """Has a scene drawn and published."""
        self._renderer.send(sample)

    def flush(self) -> None:
        """Has nothing to send."""

    def serve_late(self) -> None:
        """Gives the last images to who has come since."""
        self._renderer.serve_late()

    def forget(self, name: str) -> None:
        """Needs nothing: the renderer hears of it by the load log."""

    def facts(self) -> dict[str, str]:
        """Returns what the diagnostics tell of it."""
        return {"camera_renderer": self._renderer.renderer or "starting"}

    def close(self) -> None:
        """Ends the process, which is in a hurry now: it has to take its leave of the ROS master first."""
        if self._renderer.process_id is not None:
            _give_normal_priority(self._renderer.process_id)
        self._renderer.stop()


def _give_normal_priority(process_id: int) -> None:
    """Lets an idle process run as others do; on a busy machine it might not get to its end otherwise."""
    with contextlib.suppress(OSError):  # it may be gone, or this not allowed
        for thread_id in os.listdir(f"/proc/{process_id}/task"):
            os.sched_setscheduler(int(thread_id), os.SCHED_OTHER, os.sched_param(0))


def _camera(sensor: RgbdSensor) -> Camera:
    config = sensor.config.intrinsics
    near_m, far_m = config.range
    intrinsics = Intrinsics(config.width, config.height, config.fov, near_m, far_m)
    return Camera(sensor.name, sensor.config.object_tf.tf_id, intrinsics)
