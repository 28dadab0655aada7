"""Draws a world as fast as possible, as the renderer process does, without physics or ROS."""

from __future__ import annotations

import argparse
import time

from rpbi.geometry import Pose
from rpbi.render.camera import Intrinsics, depth_in_metres
from rpbi.render.frame import Camera
from rpbi.render.mirror import Mirror
from rpbi.render.renderers import open_renderer
from rpbi.world import World

CAMERA_POSE = Pose((0.05, -2.3, 1.55), (-0.8649, 0.0, 0.0, 0.5019))


def main() -> None:
    """Prints images (colour and depth) a second."""
    parser = argparse.ArgumentParser()
    parser.add_argument("world", help="main YAML file")
    parser.add_argument("seconds", type=float)
    arguments = parser.parse_args()
    world = World.from_file(arguments.world)
    assert world.config.rgbd_sensor is not None
    config = world.config.rgbd_sensor.intrinsics
    near_m, far_m = config.range
    intrinsics = Intrinsics(config.width, config.height, config.fov, near_m, far_m)
    renderer = open_renderer([Camera("camera", "rpbi/camera", intrinsics)])
    mirror = Mirror(renderer.pb)
    for entry in world.log:
        mirror.apply(entry)
    renderer.draw(intrinsics, CAMERA_POSE, segmentation=False)
    images = 0
    start_s = time.monotonic()
    while time.monotonic() - start_s < arguments.seconds:
        drawing = renderer.draw(intrinsics, CAMERA_POSE, segmentation=False)
        depth_in_metres(drawing.depth_buffer, intrinsics)
        images += 1
    print("result:", images / (time.monotonic() - start_s))


if __name__ == "__main__":
    main()
